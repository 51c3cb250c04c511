"""Transfer between particles and grid: quadratic B-splines over 27 nodes, and their adjoints written by hand.

These four sums take most of a simulation's time. They are native code, because what makes them fast cannot be said in
Warp's language: vectors of four numbers on a CPU, and on a GPU additions of four numbers that return nothing. The
adjoints are those of the plain sums; Warp's automatic ones would keep 27 sets of intermediates. Only finite numbers
may be scattered: NaN would stay in nodes that were reached with weight zero.

Notation as in `native`: q the position in cells from the node (0, 0, 0).
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportInvalidTypeForm=false, reportReturnType=false

import warp as wp

from app.sim.mpm.simd_intrinsics import RUNS, SLOPES, STENCIL, VECTOR, one_thread

Mat34 = wp.types.matrix(shape=(3, 4), dtype=float)


SCATTER = (
    VECTOR
    + STENCIL
    + RUNS
    + """
    f4* nodes = NODES(mass);
    const f4 ax = {affine.data[0][0], affine.data[1][0], affine.data[2][0], 0.0f};
    const f4 ay = {affine.data[0][1], affine.data[1][1], affine.data[2][1], 0.0f};
    const f4 az = {affine.data[0][2], affine.data[1][2], affine.data[2][2], 0.0f};
    const f4 middle = {momentum[0], momentum[1], momentum[2], m};
    f4 pi = middle - ax * fx - ay * fy - az * fz;
    EACH_PLANE(pi += ax) {
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


@wp.func_native(one_thread(SCATTER))
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


GATHER = (
    VECTOR
    + STENCIL
    + """
    const f4* nodes = NODES(velocity);
    f4 v = {0.0f, 0.0f, 0.0f, 0.0f}, bx = v, by = v, bz = v;
    EACH_PLANE() {
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
    ADD_PLANES(&out.data[0][0], 12);
    return out;
"""
)


@wp.func_native(one_thread(GATHER))
def gather(q: wp.vec3, blocks_y: int, blocks_z: int, slot: int, velocity: wp.array2d[wp.vec4]) -> Mat34:
    """G2P: [B | v] of a particle from the 27 nodes around it; B = sum of w v (node - particle)^T, in cells."""


GATHER_ADJOINT = (
    VECTOR
    + STENCIL
    + SLOPES
    + RUNS
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
    EACH_PLANE(ai += ax) {
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
    float out[3] = {SUM(along_x) - SUM(ax * u), SUM(along_y) - SUM(ay * u), SUM(along_z) - SUM(az * u)};
    ADD_PLANES(out, 3);
    return wp::vec_t<3, float>(out[0], out[1], out[2]);
"""
)


@wp.func_native(one_thread(GATHER_ADJOINT))
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


SCATTER_ADJOINT = (
    VECTOR
    + STENCIL
    + SLOPES
    + """
    const f4* bars = NODES(node_bars);
    const f4 ax = {affine.data[0][0], affine.data[1][0], affine.data[2][0], 0.0f};
    const f4 ay = {affine.data[0][1], affine.data[1][1], affine.data[2][1], 0.0f};
    const f4 az = {affine.data[0][2], affine.data[1][2], affine.data[2][2], 0.0f};
    const f4 middle = {momentum[0], momentum[1], momentum[2], m};
    const f4 zero = {0.0f, 0.0f, 0.0f, 0.0f};
    f4 pi = middle - ax * fx - ay * fy - az * fz;
    f4 along_x = zero, along_y = zero, along_z = zero, p_bar = zero, bx = zero, by = zero, bz = zero;
    EACH_PLANE(pi += ax) {
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
    ADD_PLANES(&out.data[0][0], 16);
    return out;
"""
)


@wp.func_native(one_thread(SCATTER_ADJOINT))
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
