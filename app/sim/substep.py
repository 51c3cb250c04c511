"""One substep of one particle or node - particles to grid, grid operation, grid to particles - and its adjoint.

These are the pieces that the kernels of `app.sim.kernels` call in loops or threads. Whatever is off the grid gives
nothing to it and becomes NaN, which the rollout extends to its whole candidate.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportInvalidTypeForm=false

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import warp as wp

from app.sim.constants import Constants
from app.sim.effects.base import Effect, NodeFunction
from app.sim.memory import Grid, GridBars, History, Particles
from app.sim.params import NOMINAL_PHYSICS
from app.sim.physics import (
    FINGER_FRICTION,
    TABLE_FRICTION,
    finger_contact,
    particle_forward,
    particle_work,
    table_contact,
)
from app.sim.transfer import (
    gather,
    gather_adjoint,
    inside,
    scatter,
    scatter_adjoint,
    scatter_touch,
    scatter_touch_adjoint,
)

LEAST_MASS = wp.constant(1.0e-8)
"""Nodes with less than this share of a particle's mass do not move: the square of their mass would underflow."""

FAR_TOO_LARGE = wp.constant(1.0e30)
"""A square that no momentum, stress or cotangent of a sound simulation comes near."""


@wp.func
def _finite(a: wp.vec3, A: wp.mat33) -> bool:
    """False for NaN, infinity and what is on the way there."""
    return wp.dot(a, a) + wp.ddot(A, A) < FAR_TOO_LARGE


@wp.func
def particles_to_grid(
    k: Constants, phi: Any, tip: wp.vec3, b: int, p: int, read: int, write: int, slot: int, h: History, grid: Grid
):
    """Stress and contact of particle `p`, scattered to the grid; its new F."""
    x = h.x[b, read, p]
    if inside(k, x):
        momentum, affine, touch, F = particle_forward(k, phi, x, h.v[b, read, p], h.C[b, read, p], h.F[b, read, p], tip)
        h.F[b, write, p] = F
        if _finite(momentum, affine):
            scatter(k, x, momentum, affine, slot, grid)
            scatter_touch(k, x, touch, slot, grid)
        else:
            h.F[b, write, p] = wp.nan * F


@wp.func
def grid_to_particles(k: Constants, b: int, p: int, read: int, write: int, slot: int, h: History, grid: Grid):
    """The new x, v and C of particle `p`."""
    x = h.x[b, read, p]
    if inside(k, x):
        v, C = gather(k, x, slot, grid)
        h.v[b, write, p] = v
        h.C[b, write, p] = C
        h.x[b, write, p] = x + k.dt * v
    else:
        h.x[b, write, p] = wp.vec3(wp.nan, wp.nan, wp.nan)


@wp.func
def grid_to_particles_adjoint(
    k: Constants, b: int, p: int, s: int, slot: int, h: History, bars: Particles, grid: Grid, grid_bars: GridBars
):
    """Cotangents of x, v and C after substep `s` to those of node velocities and, in part, of x before it."""
    x = h.x[b, s, p]
    if inside(k, x):
        v_bar = bars.v[b, p] + k.dt * bars.x[b, p]
        if _finite(v_bar, bars.C[b, p]):
            bars.x[b, p] = bars.x[b, p] + gather_adjoint(k, x, v_bar, bars.C[b, p], slot, grid, grid_bars)
        else:
            bars.x[b, p] = wp.vec3(wp.nan, wp.nan, wp.nan)


@wp.func
def particles_to_grid_adjoint(
    k: Constants,
    phi: Any,
    tip: wp.vec3,
    b: int,
    p: int,
    s: int,
    slot: int,
    h: History,
    bars: Particles,
    grid_bars: GridBars,
):
    """Cotangents of the nodes and of F to those of the state before substep `s`; returns those of phi and the tip."""
    phi_bar = phi - phi
    tip_bar = wp.vec3()
    x = h.x[b, s, p]
    if inside(k, x):
        v = h.v[b, s, p]
        C = h.C[b, s, p]
        F = h.F[b, s, p]
        momentum, affine, touch, _F_next = particle_forward(k, phi, x, v, C, F, tip)
        momentum_bar, affine_bar, mass_x = scatter_adjoint(k, x, momentum, affine, slot, grid_bars)
        touch_bar, touch_x = scatter_touch_adjoint(k, x, touch, slot, grid_bars)
        _k, phi_part, x_bar, v_bar, C_bar, F_bar, tip_part, _m, _a, _t, _f = wp.grad(particle_work)(
            k, phi, x, v, C, F, tip, momentum_bar, affine_bar, touch_bar, bars.F[b, p]
        )
        bars.x[b, p] = bars.x[b, p] + mass_x + touch_x + x_bar
        bars.v[b, p] = v_bar
        bars.C[b, p] = C_bar
        bars.F[b, p] = F_bar
        phi_bar = phi_part
        tip_bar = tip_part
    return phi_bar, tip_bar


@wp.func
def tip_velocity(k: Constants, tool: wp.array2d[wp.vec3], b: int, s: int) -> wp.vec3:
    """Of the finger during substep `s` [m/s]."""
    return (tool[b, s + 1] - tool[b, s]) / k.dt


@wp.func
def clear(n: int, slot: int, grid: Grid):
    """Node number `n` of the active ones is as if it had never been touched."""
    i = grid.active[slot, n]
    grid.mass[slot, i] = wp.vec4()
    grid.touch[slot, i] = wp.vec4()
    grid.velocity[slot, i] = wp.vec4()


@wp.func
def clear_bars(n: int, slot: int, grid: Grid, grid_bars: GridBars):
    """Likewise its cotangents."""
    i = grid.active[slot, n]
    grid_bars.node[slot, i] = wp.vec4()
    grid_bars.touch[slot, i] = wp.vec4()


@wp.func
def _node_position(k: Constants, node: int) -> wp.vec3:
    layer = node // k.nz
    return k.origin + k.cell * wp.vec3(float(layer // k.ny), float(layer % k.ny), float(node % k.nz))


@final
@dataclass(frozen=True, kw_only=True)
class GridOperation:
    """The part of a substep in which effects act, as Warp functions.

    `forward(k, phi, tip_v, n, slot, grid)`: momentum to velocity for active node `n`. `adjoint(..., grid_bars)`:
    returns the cotangents of phi and of the tip's velocity. `work`: the number whose gradient the adjoint is.
    """

    phi_type: type
    forward: NodeFunction
    adjoint: NodeFunction
    work: NodeFunction


def grid_operation(effects: Sequence[Effect]) -> GridOperation:
    """The grid operation with these effects compiled in."""
    apply_effects, length = _composed(effects)
    Phi = wp.types.vector(length=length, dtype=float)

    @wp.func
    def velocity(k: Constants, phi: Phi, node: wp.vec4, touch: wp.vec4, x: wp.vec3, tip_v: wp.vec3) -> wp.vec3:
        """Gravity, effects, table and finger: momentum and mass of a node at x [m] to its velocity [m/s]."""
        v = wp.vec3()
        if node[3] > LEAST_MASS * k.mass:
            v = k.decay * (wp.vec3(node[0], node[1], node[2]) / node[3]) - wp.vec3(0.0, 0.0, k.gravity * k.dt)
            v = table_contact(k, apply_effects(v, x, k.dt, phi), x, phi[TABLE_FRICTION])
            v = finger_contact(k, v, node[3], touch, tip_v, phi[FINGER_FRICTION])
        return v

    @wp.func
    def work(
        k: Constants, phi: Phi, node: wp.vec4, touch: wp.vec4, x: wp.vec3, tip_v: wp.vec3, v_bar: wp.vec3
    ) -> wp.float32:
        return wp.dot(v_bar, velocity(k, phi, node, touch, x, tip_v))

    @wp.func
    def forward(k: Constants, phi: Phi, tip_v: wp.vec3, n: int, slot: int, grid: Grid):
        i = grid.active[slot, n]
        v = velocity(k, phi, grid.mass[slot, i], grid.touch[slot, i], _node_position(k, i), tip_v)
        grid.velocity[slot, i] = wp.vec4(v[0], v[1], v[2], 0.0)

    @wp.func
    def adjoint(k: Constants, phi: Phi, tip_v: wp.vec3, n: int, slot: int, grid: Grid, grid_bars: GridBars):
        i = grid.active[slot, n]
        u = grid_bars.node[slot, i]
        _k, phi_bar, node_bar, touch_bar, _x, tip_v_bar, _v = wp.grad(work)(
            k, phi, grid.mass[slot, i], grid.touch[slot, i], _node_position(k, i), tip_v, wp.vec3(u[0], u[1], u[2])
        )
        grid_bars.node[slot, i] = node_bar
        grid_bars.touch[slot, i] = touch_bar
        return phi_bar, tip_v_bar

    return GridOperation(phi_type=Phi, forward=forward, adjoint=adjoint, work=work)


def _composed(effects: Sequence[Effect]) -> tuple[NodeFunction, int]:
    """All effects as one function of a node, and the number of parameters of phi."""
    at = len(NOMINAL_PHYSICS)
    function: NodeFunction = _no_effect
    for effect in effects:
        function = _then(function, effect, at)
        at += len(effect.parameters)
    return function, at


def _then(before: NodeFunction, effect: Effect, at: int) -> NodeFunction:
    """`before`, then the effect with its parameters at `phi[at]`."""
    apply = effect.node_velocity

    @wp.func
    def chained(v: wp.vec3, x: wp.vec3, dt: float, phi: Any) -> wp.vec3:
        return apply(before(v, x, dt, phi), x, dt, phi, at)

    return chained


@wp.func
def _no_effect(v: wp.vec3, _x: wp.vec3, _dt: float, _phi: Any) -> wp.vec3:
    return v
