"""Grid to particles: the velocity of a particle and its slopes from the 27 nodes around it; and the adjoint."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportInvalidTypeForm=false, reportUntypedFunctionDecorator=false
# pyright: reportAttributeAccessIssue=false, reportConstantRedefinition=false, reportOptionalCall=false

from typing import Any

import warp as wp

from app.sim.codegen.inputs import Place, Types
from app.sim.constants import Constants
from app.sim.effects.base import WarpFunction
from app.sim.mpm.memory import Grid, GridBars
from app.sim.mpm.p2g import finite
from app.sim.mpm.shared_transfer import Transfers
from app.sim.mpm.sparse_grid_blocks import cells, inside


def to_particles_of(hold: WarpFunction | None, types: Types, transfers: Transfers) -> WarpFunction:
    """`to_particles(k, a, w, x, grid) -> x, v, C`, held out of what is thin by `touching.barrier`, if anything is."""
    Inputs, gather = types.Inputs, transfers.gather

    @wp.func
    def to_particles(k: Constants, a: Inputs, w: Place, x: wp.vec3, grid: Grid):
        x_next = wp.vec3(wp.nan, wp.nan, wp.nan)
        v = wp.vec3()
        C = wp.mat33()
        if inside(k, x):
            motion = gather(cells(k, x), k.blocks_y, k.blocks_z, w.slot, grid.velocity)
            v = _last_column(motion)
            C = (4.0 * k.per_cell) * _slopes(motion)
            x_next = x + k.dt * v
            if wp.static(hold is not None):
                x_next, v = hold(k, x_next, v, a.tool[w.b, w.s], a.tool[w.b, w.s + 1])
        return x_next, v, C

    return to_particles


def to_particles_adjoint_of(held: WarpFunction | None, types: Types, transfers: Transfers) -> WarpFunction:
    """`to_particles_adjoint(k, a, w, x, x_next_bar, v_next_bar, C_bar, grid, grid_bars)`, given `hold_work`.

    Adds to the cotangents of the nodes; returns that of x before the substep, in part, and those of the tools'
    coordinates before and after it.
    """
    Inputs, Pose, gather, gather_adjoint = types.Inputs, types.Pose, transfers.gather, transfers.gather_adjoint

    @wp.func
    def to_particles_adjoint(
        k: Constants,
        a: Inputs,
        w: Place,
        x: wp.vec3,
        x_next_bar: wp.vec3,
        v_next_bar: wp.vec3,
        C_bar: wp.mat33,
        grid: Grid,
        grid_bars: GridBars,
    ):
        now_bar = Pose()
        then_bar = Pose()
        x_bar = wp.vec3(wp.nan, wp.nan, wp.nan)
        if inside(k, x):
            q = cells(k, x)
            x_bar = x_next_bar
            v_bar = v_next_bar
            if wp.static(held is not None):
                v = _last_column(gather(q, k.blocks_y, k.blocks_z, w.slot, grid.velocity))
                _k, x_bar, v_bar, now_bar, then_bar, _x, _v = wp.grad(held)(
                    k, x + k.dt * v, v, a.tool[w.b, w.s], a.tool[w.b, w.s + 1], x_next_bar, v_next_bar
                )
            v_bar = v_bar + k.dt * x_bar
            if finite(v_bar, C_bar):
                B_bar = (4.0 * k.per_cell) * C_bar
                x_bar += k.per_cell * gather_adjoint(
                    q, v_bar, B_bar, k.blocks_y, k.blocks_z, w.slot, grid.velocity, grid_bars.node
                )
            else:
                x_bar = wp.vec3(wp.nan, wp.nan, wp.nan)
        return x_bar, now_bar, then_bar

    return to_particles_adjoint


@wp.func
def _last_column(motion: Any) -> wp.vec3:
    return wp.vec3(motion[0, 3], motion[1, 3], motion[2, 3])


@wp.func
def _slopes(a: Any) -> wp.mat33:
    return wp.mat33(a[0, 0], a[0, 1], a[0, 2], a[1, 0], a[1, 1], a[1, 2], a[2, 0], a[2, 1], a[2, 2])
