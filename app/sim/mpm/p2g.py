"""Particles to grid: stress and contact of a particle, given to the 27 nodes around it; and the adjoint."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportInvalidTypeForm=false, reportUntypedFunctionDecorator=false
# pyright: reportAttributeAccessIssue=false, reportConstantRedefinition=false, reportOptionalCall=false

from typing import Any

import warp as wp

from app.sim.codegen.inputs import Place, Types, grain_of
from app.sim.constants import Constants, Matter
from app.sim.effects.base import WarpFunction
from app.sim.mpm.memory import Grid, GridBars
from app.sim.mpm.shared_transfer import Transfers
from app.sim.mpm.simd_layout import affine as affine_of
from app.sim.mpm.simd_layout import load_deformation, load_motion, position
from app.sim.mpm.simd_layout import velocity as velocity_of
from app.sim.mpm.sparse_grid_blocks import cells, enlist, enlist_felt, inside

FAR_TOO_LARGE = wp.constant(1.0e30)
"""A square that no momentum, stress or cotangent of a sound simulation comes near."""


@wp.func
def finite(a: wp.vec3, A: wp.mat33) -> bool:
    """False for NaN, infinity and numbers about to overflow."""
    return wp.dot(a, a) + wp.ddot(A, A) < FAR_TOO_LARGE


def to_grid_of(particle: WarpFunction, types: Types, transfers: Transfers) -> WarpFunction:
    """`to_grid(k, a, m, w, p, x, v, C, F, grid) -> F`: the new F. What is not finite gives nothing and becomes NaN."""
    Inputs, scatter, scatter_touch = types.Inputs, transfers.scatter, transfers.touch

    @wp.func
    def to_grid(
        k: Constants,
        a: Inputs,
        m: Matter,
        w: Place,
        p: int,
        x: wp.vec3,
        v: wp.vec3,
        C: wp.mat33,
        F: wp.mat33,
        grid: Grid,
    ) -> wp.mat33:
        F_next = F
        if inside(k, x):
            grain = grain_of(k, a.label[w.b, p], a.time[w.b], a.every)
            momentum, affine, mass, touch, aim, F_next = particle(
                k, m, a.phi_grain[w.b], grain, x, v, C, F, a.tool[w.b, w.s], a.tool[w.b, w.s + 1]
            )
            # A law may clamp what is not finite to what is: F is asked before, too.
            if finite(momentum, affine) and wp.ddot(F, F) < FAR_TOO_LARGE:
                q = cells(k, x)
                enlist(q, k.blocks_y, k.blocks_z, w.listing, grid.listed, grid.active, grid.count)
                scatter(q, momentum, affine, mass, k.blocks_y, k.blocks_z, w.slot, grid.mass)
                if touch[3] > 0.0:
                    enlist_felt(q, k.blocks_y, k.blocks_z, w.slot, w.stamp, grid.felt)
                    scatter_touch(q, touch, aim, k.blocks_y, k.blocks_z, w.slot, grid.touch, grid.aim)
            else:
                F_next = wp.nan * F
        return F_next

    return to_grid


def to_grid_adjoint_of(
    particle: WarpFunction,
    work: WarpFunction,
    types: Types,
    transfers: Transfers,
    body: int = 0,
    before: WarpFunction | None = None,
) -> WarpFunction:
    """`to_grid_adjoint(k, a, m, w, p, h, x_part, F_next_bar, grid_bars)`, given `particle` and `particle_work`.

    From the cotangents of the nodes, of F after the substep and, in part, of x before it, to those of x, v, C and F
    before it, of phi, and of the tools' coordinates before and after. `before` is that of the bodies before number
    `body`; it is called from here because Warp puts functions that take gradients after all those that do not.
    """
    Inputs, PhiGrain, Pose = types.Inputs, types.PhiGrain, types.Pose
    scatter_adjoint, scatter_touch_adjoint = transfers.scatter_adjoint, transfers.touch_adjoint

    @wp.func
    def to_grid_adjoint(
        k: Constants,
        a: Inputs,
        m: Matter,
        w: Place,
        p: int,
        h: wp.array4d[wp.vec4],
        x_part: wp.vec3,
        F_next_bar: wp.mat33,
        grid_bars: GridBars,
    ):
        x_bar = x_part
        v_bar = wp.vec3()
        C_bar = wp.mat33()
        F_bar = F_next_bar
        phi_bar = PhiGrain()
        now_bar = Pose()
        then_bar = Pose()
        motion = load_motion(h, w.b, w.s, p)
        x = position(motion)
        own = m.number >= body
        if wp.static(before is not None):  # noqa: SIM102 - Warp leaves out what is under a static condition alone.
            if not own:
                x_bar, v_bar, C_bar, F_bar, phi_bar, now_bar, then_bar = before(
                    k, a, m, w, p, h, x_part, F_next_bar, grid_bars
                )
        if own and inside(k, x):
            v = velocity_of(motion)
            C = affine_of(motion)
            F = load_deformation(h, w.b, w.s, p)
            phi = a.phi_grain[w.b]
            now = a.tool[w.b, w.s]
            then = a.tool[w.b, w.s + 1]
            grain = grain_of(k, a.label[w.b, p], a.time[w.b], a.every)
            momentum, affine, mass, touch, aim, _F = particle(k, m, phi, grain, x, v, C, F, now, then)
            q = cells(k, x)
            given = scatter_adjoint(q, momentum, affine, mass, k.blocks_y, k.blocks_z, w.slot, grid_bars.node)
            q_bar = _last_row(given)
            touch_bar = wp.vec4()
            aim_bar = wp.vec4()
            if touch[3] > 0.0:
                felt = scatter_touch_adjoint(
                    q, touch, aim, k.blocks_y, k.blocks_z, w.slot, grid_bars.touch, grid_bars.aim
                )
                touch_bar = wp.vec4(felt[0, 0], felt[0, 1], felt[0, 2], felt[0, 3])
                aim_bar = wp.vec4(felt[1, 0], felt[1, 1], felt[1, 2], felt[1, 3])
                q_bar += wp.vec3(felt[2, 0], felt[2, 1], felt[2, 2])
            momentum_bar = wp.vec3(given[0, 3], given[1, 3], given[2, 3])
            _k, _m, phi_bar, _grain, x_own, v_bar, C_bar, F_bar, now_bar, then_bar, _a, _b, _c, _d, _e, _f = wp.grad(
                work
            )(
                k,
                m,
                phi,
                grain,
                x,
                v,
                C,
                F,
                now,
                then,
                momentum_bar,
                _upper_left(given),
                given[3, 3],
                touch_bar,
                aim_bar,
                F_next_bar,
            )
            x_bar = x_part + k.per_cell * q_bar + x_own
        return x_bar, v_bar, C_bar, F_bar, phi_bar, now_bar, then_bar

    return to_grid_adjoint


def to_grid_by_body(one: WarpFunction, other: WarpFunction, body: int, types: Types) -> WarpFunction:
    """`one` for particles of the bodies before number `body`, `other` for its own."""
    Inputs = types.Inputs

    @wp.func
    def to_grid(
        k: Constants,
        a: Inputs,
        m: Matter,
        w: Place,
        p: int,
        x: wp.vec3,
        v: wp.vec3,
        C: wp.mat33,
        F: wp.mat33,
        grid: Grid,
    ) -> wp.mat33:
        F_next = F
        if m.number < body:
            F_next = one(k, a, m, w, p, x, v, C, F, grid)
        if m.number >= body:
            F_next = other(k, a, m, w, p, x, v, C, F, grid)
        return F_next

    return to_grid


@wp.func
def _last_row(given: wp.mat44) -> wp.vec3:
    return wp.vec3(given[3, 0], given[3, 1], given[3, 2])


@wp.func
def _upper_left(a: Any) -> wp.mat33:
    return wp.mat33(a[0, 0], a[0, 1], a[0, 2], a[1, 0], a[1, 1], a[1, 2], a[2, 0], a[2, 1], a[2, 2])
