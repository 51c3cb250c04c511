"""Between particles and grid: quadratic B-splines over 27 nodes, and their adjoints written by hand.

These four sums take most of a simulation's time. They are native code, because what makes them fast cannot be said in
Warp's language: vectors of four numbers on a CPU, and on a GPU additions of four numbers that return nothing. The
adjoints are those of the plain sums; Warp's automatic ones would keep 27 sets of intermediates. Only finite numbers
may be scattered: NaN would stay in nodes that were reached with weight zero.

Notation: q the position in cells from the node (0, 0, 0), f = q minus the first of the three nodes along each axis.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportInvalidTypeForm=false

import warp as wp

from app.sim.constants import BLOCK_NODES, BLOCK_SHIFT, Constants


def in_blocks(code: str) -> str:
    """Native code with the shape of a block filled in: its shifts SX SY SZ and masks MX MY MZ."""
    for axis, shift in zip("XYZ", BLOCK_SHIFT, strict=True):
        code = code.replace(f"S{axis}", str(shift)).replace(f"M{axis}", str(2**shift - 1))
    return code


Mat34 = wp.types.matrix(shape=(3, 4), dtype=float)

_VECTOR = """
#if defined(__CUDA_ARCH__)
    struct __align__(16) f4 {
        float c[4];
        CUDA_CALLABLE f4 operator+(const f4& o) const { return {c[0]+o.c[0], c[1]+o.c[1], c[2]+o.c[2], c[3]+o.c[3]}; }
        CUDA_CALLABLE f4 operator-(const f4& o) const { return {c[0]-o.c[0], c[1]-o.c[1], c[2]-o.c[2], c[3]-o.c[3]}; }
        CUDA_CALLABLE f4 operator*(const f4& o) const { return {c[0]*o.c[0], c[1]*o.c[1], c[2]*o.c[2], c[3]*o.c[3]}; }
        CUDA_CALLABLE f4 operator*(float s) const { return {c[0]*s, c[1]*s, c[2]*s, c[3]*s}; }
        CUDA_CALLABLE f4& operator+=(const f4& o) { *this = *this + o; return *this; }
        CUDA_CALLABLE float operator[](int i) const { return c[i]; }
    };
#else
    typedef float f4 __attribute__((vector_size(16), aligned(16)));
#endif
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
    #define ADD_TO(node, value) do { const f4 _a = (value); asm volatile("red.global.add.v4.f32 [%0], {%1,%2,%3,%4};" \\
        :: "l"(&(node)), "f"(_a[0]), "f"(_a[1]), "f"(_a[2]), "f"(_a[3]) : "memory"); } while (0)
#elif defined(__CUDA_ARCH__)
    #define ADD_TO(node, value) do { const f4 _a = (value); float* _n = (float*)&(node); \\
        for (int _c = 0; _c < 4; _c++) atomicAdd(_n + _c, _a[_c]); } while (0)
#else
    #define ADD_TO(node, value) (node) += (value)
#endif
    #define NODES(array) ((f4*)(array).data + (long long)slot * (array).shape[1])
    #define SUM(a) ((a)[0] + (a)[1] + (a)[2] + (a)[3])
"""
"""Four floats, their sum over nodes, and the nodes of a slot."""

_RUNS = """
#if defined(__CUDA_ARCH__)
    const unsigned here = __activemask(), lane = threadIdx.x & 31;
    const int cell = i0 << 20 | j0 << 10 | k0, cell_before = __shfl_up_sync(here, cell, 1);
    const bool first = lane == 0 || !(here >> (lane - 1) & 1) || cell_before != cell;
    const unsigned after = (__ballot_sync(here, first) | ~here) & ~((2u << lane) - 1u);
    const int left = (after ? __ffs(after) - 1 : 32) - (int)lane;
    const int longest = __reduce_max_sync(here, left);
    #define ADD_ROW(row, one, two, three) do { \\
        f4 _s[3] = {one, two, three}; \\
        for (int _step = 1; _step < longest; _step *= 2) { \\
            f4 _o[3]; \\
            _Pragma("unroll") for (int _n = 0; _n < 3; _n++) \\
                _Pragma("unroll") for (int _c = 0; _c < 4; _c++) \\
                    _o[_n].c[_c] = __shfl_down_sync(here, _s[_n].c[_c], _step); \\
            if (_step < left) { _s[0] += _o[0]; _s[1] += _o[1]; _s[2] += _o[2]; } \\
        } \\
        if (first) { ADD_TO((row)[oz[0]], _s[0]); ADD_TO((row)[oz[1]], _s[1]); ADD_TO((row)[oz[2]], _s[2]); } \\
    } while (0)
#else
    #define ADD_ROW(row, one, two, three) do { \\
        ADD_TO((row)[oz[0]], one); ADD_TO((row)[oz[1]], two); ADD_TO((row)[oz[2]], three); } while (0)
#endif
"""
"""Additions to a row of nodes by a whole run of a warp's threads at once: those in a row whose particles share a cell.

A GPU's second-level cache adds one number at a time; particles that are sorted by place (`order`) need a fraction of
the additions. `left` counts the threads of the run from this one on.
"""

_STENCIL = """
    const int i0 = (int)(q[0] - 0.5f), j0 = (int)(q[1] - 0.5f), k0 = (int)(q[2] - 0.5f);
    const float fx = q[0] - i0, fy = q[1] - j0, fz = q[2] - k0;
    const float wx[3] = {0.5f*(1.5f-fx)*(1.5f-fx), 0.75f-(fx-1.0f)*(fx-1.0f), 0.5f*(fx-0.5f)*(fx-0.5f)};
    const float wy[3] = {0.5f*(1.5f-fy)*(1.5f-fy), 0.75f-(fy-1.0f)*(fy-1.0f), 0.5f*(fy-0.5f)*(fy-0.5f)};
    const float wz[3] = {0.5f*(1.5f-fz)*(1.5f-fz), 0.75f-(fz-1.0f)*(fz-1.0f), 0.5f*(fz-0.5f)*(fz-0.5f)};
    int ox[3], oy[3], oz[3];
    #pragma unroll
    for (int n = 0; n < 3; n++) {
        ox[n] = (((i0 + n) >> SX) * blocks_y * blocks_z << (SX + SY + SZ)) + (((i0 + n) & MX) << (SY + SZ));
        oy[n] = (((j0 + n) >> SY) * blocks_z << (SX + SY + SZ)) + (((j0 + n) & MY) << SZ);
        oz[n] = (((k0 + n) >> SZ) << (SX + SY + SZ)) + ((k0 + n) & MZ);
    }
"""
_STENCIL = in_blocks(_STENCIL)
"""Weights and places of the nodes along each axis: node (i, j, k) of the 27 lies at ox[i] + oy[j] + oz[k]."""

_SLOPES = """
    const float sx[3] = {fx - 1.5f, -2.0f * (fx - 1.0f), fx - 0.5f};
    const float sy[3] = {fy - 1.5f, -2.0f * (fy - 1.0f), fy - 0.5f};
    const float sz[3] = {fz - 1.5f, -2.0f * (fz - 1.0f), fz - 0.5f};
"""
"""Derivatives of the weights with respect to f."""


SIDE_X, SIDE_Y, SIDE_Z = (wp.constant(2**shift) for shift in BLOCK_SHIFT)


@wp.func
def inside(k: Constants, x: wp.vec3) -> bool:
    """Whether all 27 nodes around `x` exist; False for NaN."""
    q = cells(k, x)
    return (
        q[0] >= 0.5
        and q[1] >= 0.5
        and q[2] >= 0.5
        and q[0] < float(k.nx) - 1.5
        and q[1] < float(k.ny) - 1.5
        and q[2] < float(k.nz) - 1.5
    )


@wp.func
def cells(k: Constants, x: wp.vec3) -> wp.vec3:
    """A position in cells from the node (0, 0, 0)."""
    return (x - k.origin) * k.per_cell


@wp.func
def node_position(k: Constants, node: int) -> wp.vec3:
    """Of a node [m], given its place in memory."""
    block = node // BLOCK_NODES
    i = SIDE_X * (block // (k.blocks_y * k.blocks_z)) + (node // (SIDE_Y * SIDE_Z)) % SIDE_X
    j = SIDE_Y * ((block // k.blocks_z) % k.blocks_y) + (node // SIDE_Z) % SIDE_Y
    n = SIDE_Z * (block % k.blocks_z) + node % SIDE_Z
    return k.origin + k.cell * wp.vec3(float(i), float(j), float(n))


_BLOCKS = """
    const int i0 = (int)(q[0] - 0.5f), j0 = (int)(q[1] - 0.5f), k0 = (int)(q[2] - 0.5f);
    const int i1 = (i0 + 2) >> SX, j1 = (j0 + 2) >> SY, k1 = (k0 + 2) >> SZ;
    int blocks[8];
    bool own[8];
    #pragma unroll
    for (int n = 0; n < 8; n++) {
        const int i = (n & 4) ? i1 : i0 >> SX, j = (n & 2) ? j1 : j0 >> SY, k = (n & 1) ? k1 : k0 >> SZ;
        blocks[n] = (i * blocks_y + j) * blocks_z + k;
        own[n] = !((n & 4) && i1 == (i0 >> SX)) && !((n & 2) && j1 == (j0 >> SY)) && !((n & 1) && k1 == (k0 >> SZ));
    }
"""
_BLOCKS = in_blocks(_BLOCKS)
"""The blocks around a particle: those of the eight that are `own` are one to eight different ones."""


@wp.func_native(
    _BLOCKS
    + """
    int* known = listed.data + (long long)listing * listed.shape[1];
    int* members = active.data + (long long)listing * active.shape[1];
    int seen[8];
    #pragma unroll
    for (int n = 0; n < 8; n++)
        seen[n] = own[n] ? known[blocks[n]] : 1;
    #pragma unroll
    for (int n = 0; n < 8; n++) {
        if (seen[n] == 0) {
        #if defined(__CUDA_ARCH__)
            if (atomicExch(known + blocks[n], 1) == 0)
                members[atomicAdd(count.data + listing, 1)] = blocks[n];
        #else
            known[blocks[n]] = 1;
            members[count.data[listing]++] = blocks[n];
        #endif
        }
    }
"""
)
def enlist(
    q: wp.vec3,
    blocks_y: int,
    blocks_z: int,
    listing: int,
    listed: wp.array2d[wp.int32],
    active: wp.array2d[wp.int32],
    count: wp.array[wp.int32],
):
    """Put the blocks around a particle on a list of active ones, where they stay for the whole action."""


@wp.func_native(
    _BLOCKS
    + """
    int* stamps = felt.data + (long long)slot * felt.shape[1];
    #pragma unroll
    for (int n = 0; n < 8; n++)
        stamps[blocks[n]] = stamp;
"""
)
def enlist_felt(q: wp.vec3, blocks_y: int, blocks_z: int, slot: int, stamp: int, felt: wp.array2d[wp.int32]):
    """Say of the blocks around a particle that a tool touches there."""


@wp.func_native(
    _VECTOR
    + _STENCIL
    + _RUNS
    + """
    f4* nodes = NODES(mass);
    const f4 ax = {affine.data[0][0], affine.data[1][0], affine.data[2][0], 0.0f};
    const f4 ay = {affine.data[0][1], affine.data[1][1], affine.data[2][1], 0.0f};
    const f4 az = {affine.data[0][2], affine.data[1][2], affine.data[2][2], 0.0f};
    const f4 middle = {momentum[0], momentum[1], momentum[2], m};
    f4 pi = middle - ax * fx - ay * fy - az * fz;
    #pragma unroll
    for (int i = 0; i < 3; i++, pi += ax) {
        f4 pj = pi;
        #pragma unroll
        for (int j = 0; j < 3; j++, pj += ay) {
            f4* row = nodes + ox[i] + oy[j];
            const float w = wx[i] * wy[j];
            ADD_ROW(row, pj * (w * wz[0]), (pj + az) * (w * wz[1]), (pj + az * 2.0f) * (w * wz[2]));
        }
    }
"""
)
def scatter(
    q: wp.vec3,
    momentum: wp.vec3,
    affine: wp.mat33,
    m: float,
    blocks_y: int,
    blocks_z: int,
    slot: int,
    mass: wp.array2d[wp.vec4],
):
    """P2G: add a particle's momentum, momentum slope a cell and mass to the 27 nodes around it."""


@wp.func_native(
    _VECTOR
    + _STENCIL
    + """
    const f4* nodes = NODES(velocity);
    f4 v = {0.0f, 0.0f, 0.0f, 0.0f}, bx = v, by = v, bz = v;
    #pragma unroll
    for (int i = 0; i < 3; i++) {
        f4 vi = {0.0f, 0.0f, 0.0f, 0.0f}, yi = vi, zi = vi;
        #pragma unroll
        for (int j = 0; j < 3; j++) {
            const f4* row = nodes + ox[i] + oy[j];
            const f4 a = row[oz[0]] * wz[0], b = row[oz[1]] * wz[1], c = row[oz[2]] * wz[2];
            const f4 vj = a + b + c;
            vi += vj * wy[j];
            yi += vj * (wy[j] * (j - fy));
            zi += (a * (0.0f - fz) + b * (1.0f - fz) + c * (2.0f - fz)) * wy[j];
        }
        v += vi * wx[i];
        bx += vi * (wx[i] * (i - fx));
        by += yi * wx[i];
        bz += zi * wx[i];
    }
    wp::mat_t<3, 4, float> out;
    for (int c = 0; c < 3; c++) {
        out.data[c][0] = bx[c];
        out.data[c][1] = by[c];
        out.data[c][2] = bz[c];
        out.data[c][3] = v[c];
    }
    return out;
"""
)
def gather(q: wp.vec3, blocks_y: int, blocks_z: int, slot: int, velocity: wp.array2d[wp.vec4]) -> Mat34:
    """G2P: [B | v] of a particle from the 27 nodes around it; B = sum of w v (node - particle)^T, in cells."""


@wp.func_native(
    _VECTOR
    + _STENCIL
    + _SLOPES
    + _RUNS
    + """
    const f4* nodes = NODES(velocity);
    f4* bars = NODES(node_bars);
    const f4 ax = {B_bar.data[0][0], B_bar.data[1][0], B_bar.data[2][0], 0.0f};
    const f4 ay = {B_bar.data[0][1], B_bar.data[1][1], B_bar.data[2][1], 0.0f};
    const f4 az = {B_bar.data[0][2], B_bar.data[1][2], B_bar.data[2][2], 0.0f};
    const f4 middle = {v_bar[0], v_bar[1], v_bar[2], 0.0f};
    const f4 zero = {0.0f, 0.0f, 0.0f, 0.0f};
    f4 ai = middle - ax * fx - ay * fy - az * fz;
    f4 along_x = zero, along_y = zero, along_z = zero, u = zero;
    #pragma unroll
    for (int i = 0; i < 3; i++, ai += ax) {
        f4 aj = ai, whole_i = zero, y_i = zero, z_i = zero;
        #pragma unroll
        for (int j = 0; j < 3; j++, aj += ay) {
            const int row = ox[i] + oy[j];
            const float w = wx[i] * wy[j];
            f4 whole = zero, slope = zero, u_j = zero;
            ADD_ROW(bars + row, aj * (w * wz[0]), (aj + az) * (w * wz[1]), (aj + az * 2.0f) * (w * wz[2]));
            #pragma unroll
            for (int n = 0; n < 3; n++) {
                const f4 a = aj + az * (float)n;
                const f4 node = nodes[row + oz[n]];
                const f4 ua = node * a;
                whole += ua * wz[n];
                slope += ua * sz[n];
                u_j += node * wz[n];
            }
            whole_i += whole * wy[j];
            y_i += whole * sy[j];
            z_i += slope * wy[j];
            u += u_j * w;
        }
        along_x += whole_i * sx[i];
        along_y += y_i * wx[i];
        along_z += z_i * wx[i];
    }
    return wp::vec_t<3, float>(
        SUM(along_x) - SUM(ax * u), SUM(along_y) - SUM(ay * u), SUM(along_z) - SUM(az * u));
"""
)
def gather_adjoint(
    q: wp.vec3,
    v_bar: wp.vec3,
    B_bar: wp.mat33,
    blocks_y: int,
    blocks_z: int,
    slot: int,
    velocity: wp.array2d[wp.vec4],
    node_bars: wp.array2d[wp.vec4],
) -> wp.vec3:
    """Adjoint of `gather`: adds to the nodes' cotangents and returns that of q."""


@wp.func_native(
    _VECTOR
    + _STENCIL
    + _SLOPES
    + """
    const f4* bars = NODES(node_bars);
    const f4 ax = {affine.data[0][0], affine.data[1][0], affine.data[2][0], 0.0f};
    const f4 ay = {affine.data[0][1], affine.data[1][1], affine.data[2][1], 0.0f};
    const f4 az = {affine.data[0][2], affine.data[1][2], affine.data[2][2], 0.0f};
    const f4 middle = {momentum[0], momentum[1], momentum[2], m};
    const f4 zero = {0.0f, 0.0f, 0.0f, 0.0f};
    f4 pi = middle - ax * fx - ay * fy - az * fz;
    f4 along_x = zero, along_y = zero, along_z = zero, p_bar = zero, bx = zero, by = zero, bz = zero;
    #pragma unroll
    for (int i = 0; i < 3; i++, pi += ax) {
        f4 pj = pi, whole_i = zero, y_i = zero, z_i = zero, bar_i = zero, bary_i = zero, barz_i = zero;
        #pragma unroll
        for (int j = 0; j < 3; j++, pj += ay) {
            const f4* row = bars + ox[i] + oy[j];
            f4 whole = zero, slope = zero, bar = zero, barz = zero;
            #pragma unroll
            for (int n = 0; n < 3; n++) {
                const f4 node = row[oz[n]];
                const f4 pa = (pj + az * (float)n) * node;
                whole += pa * wz[n];
                slope += pa * sz[n];
                bar += node * wz[n];
                barz += node * (wz[n] * (n - fz));
            }
            whole_i += whole * wy[j];
            y_i += whole * sy[j];
            z_i += slope * wy[j];
            bar_i += bar * wy[j];
            bary_i += bar * (wy[j] * (j - fy));
            barz_i += barz * wy[j];
        }
        along_x += whole_i * sx[i];
        along_y += y_i * wx[i];
        along_z += z_i * wx[i];
        p_bar += bar_i * wx[i];
        bx += bar_i * (wx[i] * (i - fx));
        by += bary_i * wx[i];
        bz += barz_i * wx[i];
    }
    wp::mat_t<4, 4, float> out;
    for (int c = 0; c < 4; c++) {
        out.data[c][0] = bx[c];
        out.data[c][1] = by[c];
        out.data[c][2] = bz[c];
        out.data[c][3] = p_bar[c];
    }
    out.data[3][0] = SUM(along_x) - SUM(ax * p_bar);
    out.data[3][1] = SUM(along_y) - SUM(ay * p_bar);
    out.data[3][2] = SUM(along_z) - SUM(az * p_bar);
    return out;
"""
)
def scatter_adjoint(
    q: wp.vec3,
    momentum: wp.vec3,
    affine: wp.mat33,
    m: float,
    blocks_y: int,
    blocks_z: int,
    slot: int,
    node_bars: wp.array2d[wp.vec4],
) -> wp.mat44:
    """Adjoint of `scatter`: [[affine_bar | momentum_bar], [q_bar | m_bar]] from the cotangents of the nodes."""


@wp.func_native(
    _VECTOR
    + _STENCIL
    + """
    f4 *touches = NODES(touch), *aims = NODES(aim);
    const f4 t = {given_touch[0], given_touch[1], given_touch[2], given_touch[3]};
    const f4 a = {given_aim[0], given_aim[1], given_aim[2], given_aim[3]};
    #pragma unroll
    for (int i = 0; i < 3; i++)
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


@wp.func_native(
    _VECTOR
    + _STENCIL
    + _SLOPES
    + """
    const f4 *touches = NODES(touch_bars), *aims = NODES(aim_bars);
    const f4 t = {given_touch[0], given_touch[1], given_touch[2], given_touch[3]};
    const f4 a = {given_aim[0], given_aim[1], given_aim[2], given_aim[3]};
    const f4 zero = {0.0f, 0.0f, 0.0f, 0.0f};
    f4 t_bar = zero, a_bar = zero, along_x = zero, along_y = zero, along_z = zero;
    #pragma unroll
    for (int i = 0; i < 3; i++)
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
    return out;
"""
)
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
