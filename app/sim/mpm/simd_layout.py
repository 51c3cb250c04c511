"""Four numbers at a time between registers and memory, and states of particles as seven such fours.

A thread a particle writes what its neighbours write next to it, 16 bytes each: the same numbers one by one take a GPU
eight times as many transactions. Warp's own loads and stores of a vec4 are four of one float each.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportInvalidTypeForm=false, reportReturnType=false

from functools import partial

import jax
import jax.numpy as jnp
import warp as wp

from app.sim.state import State

QUADS = 7
"""Vec4 a particle: x v C and one idle number in the first four, F and three idle ones in the last three."""

Motion = wp.mat44
"""x v C as they lie."""

_FOUR = """
#if defined(__CUDA_ARCH__)
    #define LOAD(to, quads, at) do { const float4 _t = ((const float4*)(quads))[at]; \\
        (to)[0] = _t.x; (to)[1] = _t.y; (to)[2] = _t.z; (to)[3] = _t.w; } while (0)
    #define STORE(quads, at, a, b, c, d) ((float4*)(quads))[at] = make_float4(a, b, c, d)
#else
    typedef float f4 __attribute__((vector_size(16), aligned(16)));
    #define LOAD(to, quads, at) do { const f4 _t = ((const f4*)(quads))[at]; \\
        (to)[0] = _t[0]; (to)[1] = _t[1]; (to)[2] = _t[2]; (to)[3] = _t[3]; } while (0)
    #define STORE(quads, at, a, b, c, d) ((f4*)(quads))[at] = (f4){a, b, c, d}
#endif
"""


@wp.func_native(
    _FOUR
    + """
    float out[4];
    LOAD(out, nodes.data, (long long)slot * nodes.shape[1] + i);
    return wp::vec_t<4, float>(out[0], out[1], out[2], out[3]);
"""
)
def load_node(nodes: wp.array2d[wp.vec4], slot: int, i: int) -> wp.vec4:
    """Node i of a slot."""


@wp.func_native(_FOUR + "STORE(nodes.data, (long long)slot * nodes.shape[1] + i, a[0], a[1], a[2], a[3]);")
def store_node(nodes: wp.array2d[wp.vec4], slot: int, i: int, a: wp.vec4):
    """Node i of a slot."""


_PARTICLE = """
    const long long count = state.shape[3], first = (long long)(b * state.shape[1] + row) * 7 * count + p;
"""


@wp.func_native(
    _FOUR
    + _PARTICLE
    + """
    wp::mat_t<4, 4, float> out;
    for (int n = 0; n < 4; n++)
        LOAD(out.data[n], state.data, first + n * count);
    return out;
"""
)
def load_motion(state: wp.array4d[wp.vec4], b: int, row: int, p: int) -> Motion:
    """X v C of particle p in a row of candidate b; `position` to `affine` unpack them."""


@wp.func_native(
    _FOUR
    + _PARTICLE
    + """
    wp::mat_t<3, 4, float> out;
    for (int n = 0; n < 3; n++)
        LOAD(out.data[n], state.data, first + (n + 4) * count);
    return wp::mat_t<3, 3, float>(out.data[0][0], out.data[0][1], out.data[0][2], out.data[0][3], out.data[1][0],
        out.data[1][1], out.data[1][2], out.data[1][3], out.data[2][0]);
"""
)
def load_deformation(state: wp.array4d[wp.vec4], b: int, row: int, p: int) -> wp.mat33:
    """Read F."""


@wp.func_native(
    _FOUR
    + _PARTICLE
    + """
    float out[4];
    LOAD(out, state.data, first);
    return wp::vec_t<3, float>(out[0], out[1], out[2]);
"""
)
def load_position(state: wp.array4d[wp.vec4], b: int, row: int, p: int) -> wp.vec3:
    """X alone."""


@wp.func_native(
    _FOUR
    + _PARTICLE
    + """
    STORE(state.data, first, x[0], x[1], x[2], v[0]);
    STORE(state.data, first + count, v[1], v[2], C.data[0][0], C.data[0][1]);
    STORE(state.data, first + 2 * count, C.data[0][2], C.data[1][0], C.data[1][1], C.data[1][2]);
    STORE(state.data, first + 3 * count, C.data[2][0], C.data[2][1], C.data[2][2], 0.0f);
"""
)
def store_motion(
    state: wp.array4d[wp.vec4],
    b: int,
    row: int,
    p: int,
    x: wp.vec3,
    v: wp.vec3,
    C: wp.mat33,
):
    """X v C."""


@wp.func_native(
    _FOUR
    + _PARTICLE
    + """
    STORE(state.data, first + 4 * count, F.data[0][0], F.data[0][1], F.data[0][2], F.data[1][0]);
    STORE(state.data, first + 5 * count, F.data[1][1], F.data[1][2], F.data[2][0], F.data[2][1]);
    STORE(state.data, first + 6 * count, F.data[2][2], 0.0f, 0.0f, 0.0f);
"""
)
def store_deformation(state: wp.array4d[wp.vec4], b: int, row: int, p: int, F: wp.mat33):
    """F."""


@wp.func
def position(m: Motion) -> wp.vec3:
    """X [m]."""
    return wp.vec3(m[0, 0], m[0, 1], m[0, 2])


@wp.func
def velocity(m: Motion) -> wp.vec3:
    """V [m/s]."""
    return wp.vec3(m[0, 3], m[1, 0], m[1, 1])


@wp.func
def affine(m: Motion) -> wp.mat33:
    """C [1/s]."""
    return wp.mat33(m[1, 2], m[1, 3], m[2, 0], m[2, 1], m[2, 2], m[2, 3], m[3, 0], m[3, 1], m[3, 2])


@partial(jax.jit, inline=True)
def pack(state: State) -> jax.Array:
    """A state (B, N, ...) as quads, shape (B, QUADS, N, 4)."""
    candidates, particles = state.x.shape[:2]
    flat = [leaf.reshape(candidates, particles, -1) for leaf in state]
    idle = jnp.zeros((candidates, particles, 1), state.x.dtype)
    rows = jnp.concatenate([*flat[:3], idle, flat[3], idle, idle, idle], axis=-1)
    return rows.reshape(candidates, particles, QUADS, 4).transpose(0, 2, 1, 3)


@partial(jax.jit, inline=True)
def unpack(quads: jax.Array) -> State:
    """The inverse of `pack`."""
    candidates, _, particles, _ = quads.shape
    rows = quads.transpose(0, 2, 1, 3).reshape(candidates, particles, 4 * QUADS)
    C, F = rows[..., 6:15], rows[..., 16:25]
    square = (candidates, particles, 3, 3)
    return State(x=rows[..., :3], v=rows[..., 3:6], C=C.reshape(square), F=F.reshape(square))
