"""One substep of one particle or node - particles to grid, grid operation, grid to particles - and its adjoint.

These are the pieces that the kernels of `app.sim.kernels` call in loops or threads, made for one `Code`. Whatever is
off the grid gives nothing to it and becomes NaN, which the rollout extends to its whole candidate.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportInvalidTypeForm=false, reportUntypedFunctionDecorator=false
# pyright: reportAttributeAccessIssue=false

from dataclasses import dataclass
from typing import Any, final

import warp as wp

from app.sim.compiled import Code, hold_work, hooks_of, node_function, node_work, particle_function, particle_work
from app.sim.constants import BLOCK_NODES, Constants, Matter
from app.sim.effects.base import Grain, Node, WarpFunction
from app.sim.hooks import columns
from app.sim.materials.base import Law
from app.sim.memory import Grid, GridBars
from app.sim.packed import affine as affine_of
from app.sim.packed import load_deformation, load_motion, load_node, position, store_node
from app.sim.packed import velocity as velocity_of
from app.sim.params import NOMINAL_PHYSICS
from app.sim.touching import barrier
from app.sim.transfer import (
    cells,
    enlist,
    enlist_felt,
    gather,
    gather_adjoint,
    inside,
    node_position,
    scatter,
    scatter_adjoint,
    scatter_touch,
    scatter_touch_adjoint,
)

LEAST_MASS = wp.constant(1.0e-8)
"""Nodes with less than this share of a particle's mass do not move: the square of their mass would underflow."""

FAR_TOO_LARGE = wp.constant(1.0e30)
"""A square that no momentum, stress or cotangent of a sound simulation comes near."""


@final
@dataclass(frozen=True, kw_only=True)
class Pieces:
    """Warp functions of one particle or node, and the types that they share.

    `Inputs`: a struct of arrays, `phi_grain` and `phi_node` (B,), `tool` (B, T), `label` (B, N), `time` (B,).
    """

    PhiGrain: type
    PhiNode: type
    Pose: type
    Inputs: Any
    to_grid: WarpFunction
    to_particles: WarpFunction
    node: WarpFunction
    to_grid_adjoint: WarpFunction
    to_particles_adjoint: WarpFunction
    node_adjoint: WarpFunction
    worked: WarpFunction
    """Calls every function whose gradient the adjoints take: `worked(k, phi_grain, phi_node, pose, a, A)`."""


@wp.func
def _finite(a: wp.vec3, A: wp.mat33) -> bool:
    """False for NaN, infinity and what is on the way there."""
    return wp.dot(a, a) + wp.ddot(A, A) < FAR_TOO_LARGE


@wp.func
def matter_of(k: Constants, p: int) -> Matter:
    """The body that particle `p` belongs to."""
    m = k.bodies[0]
    for body in range(1, k.bodies.shape[0]):
        if p >= k.bodies[body].first:
            m = k.bodies[body]
    return m


@wp.func
def active_node(n: int, list: int, grid: Grid) -> int:
    """The place in memory of node number `n` of the active blocks."""
    return grid.active[list, n // BLOCK_NODES] * BLOCK_NODES + n % BLOCK_NODES


@wp.func
def clear(i: int, slot: int, stamp: int, grid: Grid):
    """Node `i` is as if it had never been given anything."""
    store_node(grid.mass, slot, i, wp.vec4())
    if grid.felt[slot, i // BLOCK_NODES] == stamp:
        store_node(grid.touch, slot, i, wp.vec4())
        store_node(grid.aim, slot, i, wp.vec4())


@wp.func
def clear_bars(i: int, slot: int, grid_bars: GridBars):
    """Likewise its cotangents."""
    store_node(grid_bars.node, slot, i, wp.vec4())


def make_pieces(code: Code) -> Pieces:
    """For scenes of this code."""
    lengths = columns(NOMINAL_PHYSICS, code.effects)
    PhiGrain = wp.types.vector(length=len(lengths.grain), dtype=float)
    PhiNode = wp.types.vector(length=len(lengths.node), dtype=float)
    Pose = wp.types.vector(length=max(1, code.coordinates), dtype=float)

    @wp.struct
    class Inputs:
        phi_grain: wp.array[PhiGrain]
        phi_node: wp.array[PhiNode]
        tool: wp.array2d[Pose]
        label: wp.array2d[wp.vec4]
        time: wp.array[float]

    lazy, full = hooks_of(code)
    to_grid: WarpFunction = _missing_to_grid(Inputs)
    to_grid_adjoint: WarpFunction = _missing_to_grid_adjoint(Inputs, PhiGrain, Pose)
    worked: WarpFunction = _nothing_worked
    for body, law in enumerate(code.laws):
        to_grid = _or_to_grid(to_grid, body, particle_function(code, law, lazy), Inputs)
        particle = particle_function(code, law, full)
        work = particle_work(particle)
        worked = _and_particle(worked, work)
        to_grid_adjoint = _or_to_grid_adjoint(to_grid_adjoint, body, particle, work, Inputs)
    hold = barrier(code.parts)
    held = hold_work(hold) if hold is not None else None
    to_particles, to_particles_adjoint = _to_particles(hold, held, Inputs, Pose)
    node_differentiated = node_work(node_function(code, full))
    node, node_adjoint = _node(node_function(code, lazy), node_differentiated, Inputs)
    return Pieces(
        PhiGrain=PhiGrain,
        PhiNode=PhiNode,
        Pose=Pose,
        Inputs=Inputs,
        to_grid=to_grid,
        to_particles=to_particles,
        node=node,
        to_grid_adjoint=to_grid_adjoint,
        to_particles_adjoint=to_particles_adjoint,
        node_adjoint=node_adjoint,
        worked=_and_node(_and_held(worked, held), node_differentiated),
    )


@wp.func
def _nothing_worked(k: Constants, grain: Any, node: Any, pose: Any, a: wp.vec3, A: wp.mat33) -> wp.float32:
    return wp.float32(0.0)


def _and_particle(before: WarpFunction, work: WarpFunction) -> WarpFunction:
    @wp.func
    def worked(k: Constants, grain: Any, node: Any, pose: Any, a: wp.vec3, A: wp.mat33) -> wp.float32:
        u = wp.vec4(a[0], a[1], a[2], 1.0)
        done = work(k, k.bodies[0], grain, Grain(), a, a, A, A, pose, pose, a, A, 1.0, u, u, A)
        return before(k, grain, node, pose, a, A) + done

    return worked


def _and_held(before: WarpFunction, work: WarpFunction | None) -> WarpFunction:
    if work is None:
        return before

    @wp.func
    def worked(k: Constants, grain: Any, node: Any, pose: Any, a: wp.vec3, A: wp.mat33) -> wp.float32:
        return before(k, grain, node, pose, a, A) + work(k, a, a, pose, pose, a, a)

    return worked


def _and_node(before: WarpFunction, work: WarpFunction) -> WarpFunction:
    @wp.func
    def worked(k: Constants, grain: Any, node: Any, pose: Any, a: wp.vec3, A: wp.mat33) -> wp.float32:
        u = wp.vec4(a[0], a[1], a[2], 1.0)
        return before(k, grain, node, pose, a, A) + work(k, node, u, Node(), u, u, a)

    return worked


def _missing_to_grid(Inputs: Any) -> WarpFunction:
    @wp.func
    def missing(
        k: Constants,
        a: Inputs,
        m: Matter,
        b: int,
        p: int,
        s: int,
        x: wp.vec3,
        v: wp.vec3,
        C: wp.mat33,
        F: wp.mat33,
        list: int,
        slot: int,
        stamp: int,
        grid: Grid,
    ) -> wp.mat33:
        return F

    return missing


def _or_to_grid(before: WarpFunction, body: int, particle: WarpFunction, Inputs: Any) -> WarpFunction:
    """`to_grid(k, a, m, b, p, s, x, v, C, F, list, slot, stamp, grid)`: stress and contact, scattered; returns the new F."""

    @wp.func
    def to_grid(
        k: Constants,
        a: Inputs,
        m: Matter,
        b: int,
        p: int,
        s: int,
        x: wp.vec3,
        v: wp.vec3,
        C: wp.mat33,
        F: wp.mat33,
        list: int,
        slot: int,
        stamp: int,
        grid: Grid,
    ) -> wp.mat33:
        F_next = F
        if m.number < body:
            F_next = before(k, a, m, b, p, s, x, v, C, F, list, slot, stamp, grid)
        else:
            if inside(k, x):
                grain = Grain()
                grain.label = a.label[b, p]
                grain.time = a.time[b]
                grain.dt = k.dt
                momentum, affine, mass, touch, aim, F_next = particle(
                    k, m, a.phi_grain[b], grain, x, v, C, F, a.tool[b, s], a.tool[b, s + 1]
                )
                if _finite(momentum, affine):
                    q = cells(k, x)
                    enlist(q, k.blocks_y, k.blocks_z, list, grid.listed, grid.active, grid.count)
                    scatter(q, momentum, affine, mass, k.blocks_y, k.blocks_z, slot, grid.mass)
                    if touch[3] > 0.0:
                        enlist_felt(q, k.blocks_y, k.blocks_z, slot, stamp, grid.felt)
                        scatter_touch(q, touch, aim, k.blocks_y, k.blocks_z, slot, grid.touch, grid.aim)
                else:
                    F_next = wp.nan * F
        return F_next

    return to_grid


def _missing_to_grid_adjoint(Inputs: Any, PhiGrain: Any, Pose: Any) -> WarpFunction:
    @wp.func
    def missing(
        k: Constants,
        a: Inputs,
        m: Matter,
        b: int,
        p: int,
        s: int,
        slot: int,
        h: wp.array4d[wp.vec4],
        x_bar: wp.vec3,
        F_bar: wp.mat33,
        grid_bars: GridBars,
    ):
        return x_bar, wp.vec3(), wp.mat33(), F_bar, PhiGrain(), Pose(), Pose()

    return missing


def _or_to_grid_adjoint(
    before: WarpFunction, body: int, particle: WarpFunction, work: WarpFunction, Inputs: Any
) -> WarpFunction:
    """From the cotangents of the nodes, of F after substep `s` and, in part, of x before it, to those before it.

    Returns those of x, v, C, F, phi and of the tools' coordinates before and after the substep.
    """

    @wp.func
    def to_grid_adjoint(
        k: Constants,
        a: Inputs,
        m: Matter,
        b: int,
        p: int,
        s: int,
        slot: int,
        h: wp.array4d[wp.vec4],
        x_part: wp.vec3,
        F_next_bar: wp.mat33,
        grid_bars: GridBars,
    ):
        phi = a.phi_grain[b]
        now = a.tool[b, s]
        then = a.tool[b, s + 1]
        phi_bar = phi - phi
        now_bar = now - now
        then_bar = now - now
        x_bar = x_part
        v_bar = wp.vec3()
        C_bar = wp.mat33()
        F_bar = F_next_bar
        if m.number < body:
            x_bar, v_bar, C_bar, F_bar, phi_bar, now_bar, then_bar = before(
                k, a, m, b, p, s, slot, h, x_part, F_next_bar, grid_bars
            )
        else:
            motion = load_motion(h, b, s, p)
            x = position(motion)
            if inside(k, x):
                v = velocity_of(motion)
                C = affine_of(motion)
                F = load_deformation(h, b, s, p)
                grain = Grain()
                grain.label = a.label[b, p]
                grain.time = a.time[b]
                grain.dt = k.dt
                momentum, affine, mass, touch, aim, _F = particle(k, m, phi, grain, x, v, C, F, now, then)
                q = cells(k, x)
                given = scatter_adjoint(q, momentum, affine, mass, k.blocks_y, k.blocks_z, slot, grid_bars.node)
                q_bar = wp.vec3(given[3, 0], given[3, 1], given[3, 2])
                touch_bar = wp.vec4()
                aim_bar = wp.vec4()
                if touch[3] > 0.0:
                    felt = scatter_touch_adjoint(
                        q, touch, aim, k.blocks_y, k.blocks_z, slot, grid_bars.touch, grid_bars.aim
                    )
                    touch_bar = wp.vec4(felt[0, 0], felt[0, 1], felt[0, 2], felt[0, 3])
                    aim_bar = wp.vec4(felt[1, 0], felt[1, 1], felt[1, 2], felt[1, 3])
                    q_bar += wp.vec3(felt[2, 0], felt[2, 1], felt[2, 2])
                (
                    _k,
                    _m,
                    phi_bar,
                    _grain,
                    x_own,
                    v_bar,
                    C_bar,
                    F_bar,
                    now_bar,
                    then_bar,
                    _1,
                    _2,
                    _3,
                    _4,
                    _5,
                    _6,
                ) = wp.grad(work)(
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
                    wp.vec3(given[0, 3], given[1, 3], given[2, 3]),
                    wp.mat33(
                        given[0, 0],
                        given[0, 1],
                        given[0, 2],
                        given[1, 0],
                        given[1, 1],
                        given[1, 2],
                        given[2, 0],
                        given[2, 1],
                        given[2, 2],
                    ),
                    given[3, 3],
                    touch_bar,
                    aim_bar,
                    F_next_bar,
                )
                x_bar = x_part + k.per_cell * q_bar + x_own
        return x_bar, v_bar, C_bar, F_bar, phi_bar, now_bar, then_bar

    return to_grid_adjoint


def _to_particles(
    hold: WarpFunction | None, held: WarpFunction | None, Inputs: Any, Pose: Any
) -> tuple[WarpFunction, WarpFunction]:
    """The new x, v and C of a particle; its adjoint, which returns the cotangents of the tool's coordinates."""

    @wp.func
    def to_particles(k: Constants, a: Inputs, b: int, s: int, x: wp.vec3, slot: int, grid: Grid):
        x_next = wp.vec3(wp.nan, wp.nan, wp.nan)
        v = wp.vec3()
        C = wp.mat33()
        if inside(k, x):
            motion = gather(cells(k, x), k.blocks_y, k.blocks_z, slot, grid.velocity)
            v = wp.vec3(motion[0, 3], motion[1, 3], motion[2, 3])
            C = (4.0 * k.per_cell) * slopes(motion)
            x_next = x + k.dt * v
            if wp.static(hold is not None):
                x_next, v = hold(k, x_next, v, a.tool[b, s], a.tool[b, s + 1])
        return x_next, v, C

    @wp.func
    def to_particles_adjoint(
        k: Constants,
        a: Inputs,
        b: int,
        s: int,
        x: wp.vec3,
        x_next_bar: wp.vec3,
        v_next_bar: wp.vec3,
        C_bar: wp.mat33,
        slot: int,
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
            if wp.static(hold is not None):
                motion = gather(q, k.blocks_y, k.blocks_z, slot, grid.velocity)
                v = wp.vec3(motion[0, 3], motion[1, 3], motion[2, 3])
                _k, x_bar, v_bar, now_bar, then_bar, _x, _v = wp.grad(held)(
                    k, x + k.dt * v, v, a.tool[b, s], a.tool[b, s + 1], x_next_bar, v_next_bar
                )
            v_bar = v_bar + k.dt * x_bar
            if _finite(v_bar, C_bar):
                q_bar = gather_adjoint(
                    q,
                    v_bar,
                    (4.0 * k.per_cell) * C_bar,
                    k.blocks_y,
                    k.blocks_z,
                    slot,
                    grid.velocity,
                    grid_bars.node,
                )
                x_bar = x_bar + k.per_cell * q_bar
            else:
                x_bar = wp.vec3(wp.nan, wp.nan, wp.nan)
        return x_bar, now_bar, then_bar

    return to_particles, to_particles_adjoint


@wp.func
def slopes(motion: Any) -> wp.mat33:
    """B of [B | v]."""
    return wp.mat33(
        motion[0, 0],
        motion[0, 1],
        motion[0, 2],
        motion[1, 0],
        motion[1, 1],
        motion[1, 2],
        motion[2, 0],
        motion[2, 1],
        motion[2, 2],
    )


def _node(velocity: WarpFunction, work: WarpFunction, Inputs: Any) -> tuple[WarpFunction, WarpFunction]:
    """Momentum to velocity for node `i` of an active block; its adjoint, which returns the cotangents of phi."""

    @wp.func
    def node(k: Constants, a: Inputs, b: int, i: int, slot: int, stamp: int, grid: Grid):
        here = load_node(grid.mass, slot, i)
        v = wp.vec3()
        if here[3] > LEAST_MASS * k.least_mass:
            place = Node()
            place.x = node_position(k, i)
            place.dt = k.dt
            place.gravity = k.gravity
            place.time = a.time[b]
            touch = wp.vec4()
            aim = wp.vec4()
            if grid.felt[slot, i // BLOCK_NODES] == stamp:
                touch = load_node(grid.touch, slot, i)
                aim = load_node(grid.aim, slot, i)
            v = velocity(k, a.phi_node[b], here, place, touch, aim)
        store_node(grid.velocity, slot, i, wp.vec4(v[0], v[1], v[2], 0.0))

    @wp.func
    def node_adjoint(
        k: Constants, a: Inputs, b: int, i: int, slot: int, stamp: int, grid: Grid, grid_bars: GridBars
    ):
        phi = a.phi_node[b]
        phi_bar = phi - phi
        here = load_node(grid.mass, slot, i)
        node_bar = wp.vec4()
        touch = wp.vec4()
        aim = wp.vec4()
        touch_bar = wp.vec4()
        aim_bar = wp.vec4()
        felt = grid.felt[slot, i // BLOCK_NODES] == stamp
        if here[3] > LEAST_MASS * k.least_mass:
            place = Node()
            place.x = node_position(k, i)
            place.dt = k.dt
            place.gravity = k.gravity
            place.time = a.time[b]
            if felt:
                touch = load_node(grid.touch, slot, i)
                aim = load_node(grid.aim, slot, i)
            u = load_node(grid_bars.node, slot, i)
            _k, phi_bar, node_bar, _place, touch_bar, aim_bar, _v = wp.grad(work)(
                k, phi, here, place, touch, aim, wp.vec3(u[0], u[1], u[2])
            )
        store_node(grid_bars.node, slot, i, node_bar)
        if felt:
            store_node(grid_bars.touch, slot, i, touch_bar)
            store_node(grid_bars.aim, slot, i, aim_bar)
        return phi_bar

    return node, node_adjoint


__all__ = ["Law", "Pieces", "active_node", "clear", "clear_bars", "make_pieces", "matter_of"]
