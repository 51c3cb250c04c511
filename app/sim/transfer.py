"""Between particles and grid: quadratic B-splines over 27 nodes, and their adjoints written by hand.

A grid node holds a vec4: first momentum and mass, then velocity. A node touched for the first time in a substep puts
itself on the list of active nodes, so that nothing ever visits the others. Only finite numbers may be scattered: NaN
would stay in nodes that were reached with weight zero, which are not on the list. The adjoints are those of the plain
sums below; Warp's automatic ones replay the scatter and keep 27 sets of intermediates.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false

import warp as wp

from app.sim.constants import Constants
from app.sim.memory import Grid, GridBars
from app.sim.physics import LEAST_TOUCH


@wp.func
def spline(f: float) -> wp.vec3:
    """Weights of the three nodes around a particle that lies `f` cells (0.5 to 1.5) above the first."""
    return wp.vec3(0.5 * (1.5 - f) * (1.5 - f), 0.75 - (f - 1.0) * (f - 1.0), 0.5 * (f - 0.5) * (f - 0.5))


@wp.func
def spline_slope(f: float) -> wp.vec3:
    """Derivatives of the weights with respect to `f`."""
    return wp.vec3(f - 1.5, -2.0 * (f - 1.0), f - 0.5)


@wp.func
def inside(k: Constants, x: wp.vec3) -> bool:
    """Whether all 27 nodes around `x` exist; False for NaN."""
    q = (x - k.origin) * k.per_cell
    return (
        q[0] >= 0.5
        and q[1] >= 0.5
        and q[2] >= 0.5
        and q[0] < float(k.nx) - 1.5
        and q[1] < float(k.ny) - 1.5
        and q[2] < float(k.nz) - 1.5
    )


@wp.func
def scatter(
    k: Constants,
    x: wp.vec3,
    momentum: wp.vec3,
    affine: wp.mat33,
    slot: int,
    grid: Grid,
):
    """P2G: add a particle's momentum and mass to the 27 nodes around it."""
    q = (x - k.origin) * k.per_cell
    i0 = int(q[0] - 0.5)
    j0 = int(q[1] - 0.5)
    k0 = int(q[2] - 0.5)
    f = q - wp.vec3(float(i0), float(j0), float(k0))
    wx = spline(f[0])
    wy = spline(f[1])
    wz = spline(f[2])
    step_z = affine * wp.vec3(0.0, 0.0, k.cell)
    for i in range(3):
        for j in range(3):
            wij = wx[i] * wy[j]
            p = momentum + affine * ((wp.vec3(float(i), float(j), 0.0) - f) * k.cell)
            row = ((i0 + i) * k.ny + j0 + j) * k.nz + k0
            for n in range(3):
                w = wij * wz[n]
                m = w * k.mass
                before = wp.atomic_add(grid.mass, slot, row + n, wp.vec4(w * p[0], w * p[1], w * p[2], m))
                if before[3] == 0.0 and m > 0.0:
                    place = wp.atomic_add(grid.count, slot, 1)
                    grid.active[slot, place] = row + n
                p += step_z


@wp.func
def gather(k: Constants, x: wp.vec3, slot: int, grid: Grid):
    """G2P: velocity and affine velocity field of a particle from the 27 nodes around it."""
    q = (x - k.origin) * k.per_cell
    i0 = int(q[0] - 0.5)
    j0 = int(q[1] - 0.5)
    k0 = int(q[2] - 0.5)
    f = q - wp.vec3(float(i0), float(j0), float(k0))
    wx = spline(f[0])
    wy = spline(f[1])
    wz = spline(f[2])
    v = wp.vec3()
    b = wp.mat33()
    for i in range(3):
        for j in range(3):
            row = ((i0 + i) * k.ny + j0 + j) * k.nz + k0
            u = wp.vec3()
            uz = wp.vec3()
            for n in range(3):
                node = grid.velocity[slot, row + n]
                part = wz[n] * wp.vec3(node[0], node[1], node[2])
                u += part
                uz += (float(n) - f[2]) * part
            wij = wx[i] * wy[j]
            v += wij * u
            b += wp.outer(wij * u, wp.vec3(float(i) - f[0], float(j) - f[1], 0.0))
            b += wp.outer(wij * uz, wp.vec3(0.0, 0.0, 1.0))
    return v, (4.0 * k.per_cell) * b


@wp.func
def gather_adjoint(
    k: Constants,
    x: wp.vec3,
    v_bar: wp.vec3,
    C_bar: wp.mat33,
    slot: int,
    grid: Grid,
    bars: GridBars,
) -> wp.vec3:
    """Adjoint of `gather`: adds to the nodes' cotangents and returns that of x."""
    q = (x - k.origin) * k.per_cell
    i0 = int(q[0] - 0.5)
    j0 = int(q[1] - 0.5)
    k0 = int(q[2] - 0.5)
    f = q - wp.vec3(float(i0), float(j0), float(k0))
    wx = spline(f[0])
    wy = spline(f[1])
    wz = spline(f[2])
    sx = spline_slope(f[0])
    sy = spline_slope(f[1])
    sz = spline_slope(f[2])
    B_bar = (4.0 * k.per_cell) * C_bar
    f_bar = wp.vec3()
    u_sum = wp.vec3()
    step_z = B_bar * wp.vec3(0.0, 0.0, 1.0)
    for i in range(3):
        for j in range(3):
            row = ((i0 + i) * k.ny + j0 + j) * k.nz + k0
            a = v_bar + B_bar * (wp.vec3(float(i), float(j), 0.0) - f)
            along = wp.float32(0.0)
            slope = wp.float32(0.0)
            for n in range(3):
                node = grid.velocity[slot, row + n]
                w = wx[i] * wy[j] * wz[n]
                wp.atomic_add(bars.node, slot, row + n, wp.vec4(w * a[0], w * a[1], w * a[2], 0.0))
                u = wp.vec3(node[0], node[1], node[2])
                ua = wp.dot(u, a)
                along += wz[n] * ua
                slope += sz[n] * ua
                u_sum += w * u
                a += step_z
            f_bar += wp.vec3(sx[i] * wy[j] * along, wx[i] * sy[j] * along, wx[i] * wy[j] * slope)
    return k.per_cell * (f_bar - wp.transpose(B_bar) * u_sum)


@wp.func
def scatter_adjoint(k: Constants, x: wp.vec3, momentum: wp.vec3, affine: wp.mat33, slot: int, bars: GridBars):
    """Adjoint of `scatter`: cotangents of momentum, affine part and x from those of the nodes."""
    q = (x - k.origin) * k.per_cell
    i0 = int(q[0] - 0.5)
    j0 = int(q[1] - 0.5)
    k0 = int(q[2] - 0.5)
    f = q - wp.vec3(float(i0), float(j0), float(k0))
    wx = spline(f[0])
    wy = spline(f[1])
    wz = spline(f[2])
    sx = spline_slope(f[0])
    sy = spline_slope(f[1])
    sz = spline_slope(f[2])
    momentum_bar = wp.vec3()
    affine_bar = wp.mat33()
    f_bar = wp.vec3()
    step_z = affine * wp.vec3(0.0, 0.0, k.cell)
    for i in range(3):
        for j in range(3):
            row = ((i0 + i) * k.ny + j0 + j) * k.nz + k0
            p = momentum + affine * ((wp.vec3(float(i), float(j), 0.0) - f) * k.cell)
            a = wp.vec3()
            az = wp.vec3()
            along = wp.float32(0.0)
            slope = wp.float32(0.0)
            for n in range(3):
                node = bars.node[slot, row + n]
                node_bar = wp.vec3(node[0], node[1], node[2])
                pa = wp.dot(p, node_bar) + k.mass * node[3]
                along += wz[n] * pa
                slope += sz[n] * pa
                part = wz[n] * node_bar
                a += part
                az += (float(n) - f[2]) * part
                p += step_z
            wij = wx[i] * wy[j]
            momentum_bar += wij * a
            affine_bar += wp.outer(wij * a, wp.vec3(float(i) - f[0], float(j) - f[1], 0.0))
            affine_bar += wp.outer(wij * az, wp.vec3(0.0, 0.0, 1.0))
            f_bar += wp.vec3(sx[i] * wy[j] * along, wx[i] * sy[j] * along, wx[i] * wy[j] * slope)
    x_bar = k.per_cell * f_bar - wp.transpose(affine) * momentum_bar
    return momentum_bar, k.cell * affine_bar, x_bar


@wp.func
def scatter_touch(k: Constants, x: wp.vec3, touch: wp.vec4, slot: int, grid: Grid):
    """Add a particle's touch to the 27 nodes around it, with the weights of its mass."""
    if touch[3] > LEAST_TOUCH * k.mass:
        q = (x - k.origin) * k.per_cell
        i0 = int(q[0] - 0.5)
        j0 = int(q[1] - 0.5)
        k0 = int(q[2] - 0.5)
        wx = spline(q[0] - float(i0))
        wy = spline(q[1] - float(j0))
        wz = spline(q[2] - float(k0))
        for i in range(3):
            for j in range(3):
                row = ((i0 + i) * k.ny + j0 + j) * k.nz + k0
                for n in range(3):
                    wp.atomic_add(grid.touch, slot, row + n, (wx[i] * wy[j] * wz[n]) * touch)


@wp.func
def scatter_touch_adjoint(k: Constants, x: wp.vec3, touch: wp.vec4, slot: int, bars: GridBars):
    """Adjoint of `scatter_touch`: cotangents of touch and x."""
    touch_bar = wp.vec4()
    f_bar = wp.vec3()
    if touch[3] > LEAST_TOUCH * k.mass:
        q = (x - k.origin) * k.per_cell
        i0 = int(q[0] - 0.5)
        j0 = int(q[1] - 0.5)
        k0 = int(q[2] - 0.5)
        f = q - wp.vec3(float(i0), float(j0), float(k0))
        wx = spline(f[0])
        wy = spline(f[1])
        wz = spline(f[2])
        sx = spline_slope(f[0])
        sy = spline_slope(f[1])
        sz = spline_slope(f[2])
        for i in range(3):
            for j in range(3):
                row = ((i0 + i) * k.ny + j0 + j) * k.nz + k0
                for n in range(3):
                    node_bar = bars.touch[slot, row + n]
                    work = wp.dot(touch, node_bar)
                    touch_bar += (wx[i] * wy[j] * wz[n]) * node_bar
                    f_bar += work * wp.vec3(sx[i] * wy[j] * wz[n], wx[i] * sy[j] * wz[n], wx[i] * wy[j] * sz[n])
    return touch_bar, k.per_cell * f_bar
