"""Touches and aims of particles (see `touching`) to the nodes around them, with the weights of their mass."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportInvalidTypeForm=false, reportReturnType=false

import warp as wp

from app.sim.mpm.simd_intrinsics import SLOPES, STENCIL, VECTOR, one_thread
from app.sim.mpm.transfer import Mat34

TOUCH = (
    VECTOR
    + STENCIL
    + """
    f4 *touches = NODES(touch), *aims = NODES(aim);
    const f4 t = {given_touch[0], given_touch[1], given_touch[2], given_touch[3]};
    const f4 a = {given_aim[0], given_aim[1], given_aim[2], given_aim[3]};
    EACH_PLANE()
        #pragma unroll
        for (int j = 0; j < 3; j++)
            #pragma unroll
            for (int n = 0; n < 3; n++) {
                const float w = wx[i] * wy[j] * wz[n];
                const int node = ox[i] + oy[j] + oz[n];
                ADD_TO(touches[node], t * w);
                ADD_TO(aims[node], a * w);
            }
"""
)


@wp.func_native(one_thread(TOUCH))
def scatter_touch(
    q: wp.vec3,
    given_touch: wp.vec4,
    given_aim: wp.vec4,
    blocks_y: int,
    blocks_z: int,
    slot: int,
    touch: wp.array2d[wp.vec4],
    aim: wp.array2d[wp.vec4],
):
    """Add a particle's touch and aim to the 27 nodes around it, with the weights of its mass."""


TOUCH_ADJOINT = (
    VECTOR
    + STENCIL
    + SLOPES
    + """
    const f4 *touches = NODES(touch_bars), *aims = NODES(aim_bars);
    const f4 t = {given_touch[0], given_touch[1], given_touch[2], given_touch[3]};
    const f4 a = {given_aim[0], given_aim[1], given_aim[2], given_aim[3]};
    const f4 zero = {0.0f, 0.0f, 0.0f, 0.0f};
    f4 t_bar = zero, a_bar = zero, along_x = zero, along_y = zero, along_z = zero;
    EACH_PLANE()
        #pragma unroll
        for (int j = 0; j < 3; j++)
            #pragma unroll
            for (int n = 0; n < 3; n++) {
                const int node = ox[i] + oy[j] + oz[n];
                const float w = wx[i] * wy[j] * wz[n];
                const f4 work = t * touches[node] + a * aims[node];
                t_bar += touches[node] * w;
                a_bar += aims[node] * w;
                along_x += work * (sx[i] * wy[j] * wz[n]);
                along_y += work * (wx[i] * sy[j] * wz[n]);
                along_z += work * (wx[i] * wy[j] * sz[n]);
            }
    wp::mat_t<3, 4, float> out;
    for (int c = 0; c < 4; c++) {
        out.data[0][c] = t_bar[c];
        out.data[1][c] = a_bar[c];
    }
    out.data[2][0] = SUM(along_x);
    out.data[2][1] = SUM(along_y);
    out.data[2][2] = SUM(along_z);
    out.data[2][3] = 0.0f;
    ADD_PLANES(&out.data[0][0], 12);
    return out;
"""
)


@wp.func_native(one_thread(TOUCH_ADJOINT))
def scatter_touch_adjoint(
    q: wp.vec3,
    given_touch: wp.vec4,
    given_aim: wp.vec4,
    blocks_y: int,
    blocks_z: int,
    slot: int,
    touch_bars: wp.array2d[wp.vec4],
    aim_bars: wp.array2d[wp.vec4],
) -> Mat34:
    """Adjoint of `scatter_touch`: rows touch_bar, aim_bar and (q_bar, 0)."""
