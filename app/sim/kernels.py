"""The substep - particles to grid, grid, grid to particles - and its adjoint, over whole actions, as Warp kernels.

`build_kernels` composes the effects into the node physics and returns the kernels. A thread owns candidates and goes
through all their substeps, so that a candidate's few active nodes stay in its core's cache.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportInvalidTypeForm=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportAttributeAccessIssue=false, reportGeneralTypeIssues=false
# pyright: reportUntypedFunctionDecorator=false

import functools
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import warp as wp

from app.sim.constants import Constants
from app.sim.effects.base import Effect, NodeFunction
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


@final
@dataclass(frozen=True, kw_only=True)
class Kernels:
    """The compiled operations and the Warp vector type of one candidate's phi."""

    phi_type: type
    advance: wp.Kernel
    retreat: wp.Kernel


@wp.func
def _no_effect(v: wp.vec3, _x: wp.vec3, _dt: float, _phi: Any) -> wp.vec3:
    return v


def _then(before: NodeFunction, effect: Effect, at: int) -> NodeFunction:
    """`before`, then the effect with its parameters at `phi[at]`."""
    apply = effect.node_velocity

    @wp.func
    def chained(v: wp.vec3, x: wp.vec3, dt: float, phi: Any) -> wp.vec3:
        return apply(before(v, x, dt, phi), x, dt, phi, at)

    return chained


def _composed(effects: Sequence[Effect]) -> tuple[NodeFunction, int]:
    """All effects as one function of a node, and the number of parameters of phi."""
    at = len(NOMINAL_PHYSICS)
    function: NodeFunction = _no_effect
    for effect in effects:
        function = _then(function, effect, at)
        at += len(effect.parameters)
    return function, at


@functools.cache
def build_kernels(effects: tuple[Effect, ...]) -> Kernels:
    """The kernels with these effects compiled in. Cheap: compilation happens at the first launch (or in warm-up)."""
    apply_effects, length = _composed(effects)
    Phi = wp.types.vector(length=length, dtype=float)
    name = hashlib.sha256(repr([spec for effect in effects for spec in effect.parameters]).encode()).hexdigest()[:8]
    module = wp.get_module(f"dipac_sim_{name}")

    @wp.func
    def node_forward(k: Constants, phi: Phi, node: wp.vec4, touch: wp.vec4, x: wp.vec3, tip_v: wp.vec3) -> wp.vec3:
        """The grid operation: momentum and mass [kg m/s, kg] of a node at x [m] to its velocity [m/s]."""
        v = wp.vec3()
        if node[3] > LEAST_MASS * k.mass:
            v = k.decay * (wp.vec3(node[0], node[1], node[2]) / node[3]) - wp.vec3(0.0, 0.0, k.gravity * k.dt)
            v = table_contact(k, apply_effects(v, x, k.dt, phi), x, phi[TABLE_FRICTION])
            v = finger_contact(k, v, node[3], touch, tip_v, phi[FINGER_FRICTION])
        return v

    @wp.func
    def node_work(
        k: Constants, phi: Phi, node: wp.vec4, touch: wp.vec4, x: wp.vec3, tip_v: wp.vec3, v_bar: wp.vec3
    ) -> wp.float32:
        return wp.dot(v_bar, node_forward(k, phi, node, touch, x, tip_v))

    @wp.func
    def node_position(k: Constants, node: int) -> wp.vec3:
        layer = node // k.nz
        return k.origin + k.cell * wp.vec3(float(layer // k.ny), float(layer % k.ny), float(node % k.nz))

    @wp.func
    def tip_velocity(k: Constants, tool: wp.array2d[wp.vec3], b: int, s: int) -> wp.vec3:
        return (tool[b, s + 1] - tool[b, s]) / k.dt

    @wp.func
    def substep(
        k: Constants,
        phi: Phi,
        b: int,
        s: int,
        tool: wp.array2d[wp.vec3],
        read: int,
        write: int,
        slot: int,
        xs: wp.array3d[wp.vec3],
        vs: wp.array3d[wp.vec3],
        Cs: wp.array3d[wp.mat33],
        Fs: wp.array3d[wp.mat33],
        grid: wp.array2d[wp.vec4],
        velocity: wp.array2d[wp.vec4],
        touches: wp.array2d[wp.vec4],
        active: wp.array2d[wp.int32],
        active_count: wp.array[wp.int32],
    ):
        """P2G and the grid operation of candidate `b` in substep `s`; leaves node velocities in `velocity`."""
        tip = tool[b, s]
        tip_v = tip_velocity(k, tool, b, s)
        for p in range(xs.shape[2]):
            x = xs[b, read, p]
            if inside(k, x):
                momentum, affine, touch, F_next = particle_forward(
                    k, phi, x, vs[b, read, p], Cs[b, read, p], Fs[b, read, p], tip
                )
                Fs[b, write, p] = F_next
                scatter(k, x, momentum, affine, slot, grid, active, active_count)
                scatter_touch(k, x, touch, slot, touches)
        for n in range(active_count[slot]):
            i = active[slot, n]
            v = node_forward(k, phi, grid[slot, i], touches[slot, i], node_position(k, i), tip_v)
            velocity[slot, i] = wp.vec4(v[0], v[1], v[2], 0.0)

    @wp.kernel(module=module, enable_backward=False)
    def advance(
        k: Constants,
        first: int,
        stride: int,
        steps: int,
        phis: wp.array[Phi],
        tool: wp.array2d[wp.vec3],
        x_start: wp.array2d[wp.vec3],
        v_start: wp.array2d[wp.vec3],
        C_start: wp.array2d[wp.mat33],
        F_start: wp.array2d[wp.mat33],
        xs: wp.array3d[wp.vec3],
        vs: wp.array3d[wp.vec3],
        Cs: wp.array3d[wp.mat33],
        Fs: wp.array3d[wp.mat33],
        grid: wp.array2d[wp.vec4],
        touches: wp.array2d[wp.vec4],
        active: wp.array2d[wp.int32],
        active_count: wp.array[wp.int32],
    ):
        """All substeps of candidates first, first + stride, ...; substep s starts from row s (modulo rows)."""
        b = first + stride * wp.tid()
        slot = first
        phi = phis[b]
        rows = xs.shape[1]
        for p in range(xs.shape[2]):
            xs[b, 0, p] = x_start[b, p]
            vs[b, 0, p] = v_start[b, p]
            Cs[b, 0, p] = C_start[b, p]
            Fs[b, 0, p] = F_start[b, p]
        for s in range(steps):
            read = s % rows
            write = (s + 1) % rows
            substep(k, phi, b, s, tool, read, write, slot, xs, vs, Cs, Fs, grid, grid, touches, active, active_count)
            for p in range(xs.shape[2]):
                x = xs[b, read, p]
                if inside(k, x):
                    v, C = gather(k, x, slot, grid)
                    vs[b, write, p] = v
                    Cs[b, write, p] = C
                    xs[b, write, p] = x + k.dt * v
                else:
                    xs[b, write, p] = wp.vec3(wp.nan, wp.nan, wp.nan)
            for n in range(active_count[slot]):
                grid[slot, active[slot, n]] = wp.vec4()
                touches[slot, active[slot, n]] = wp.vec4()
            active_count[slot] = 0

    @wp.kernel(module=module, enable_backward=False)
    def retreat(
        k: Constants,
        first: int,
        stride: int,
        steps: int,
        phis: wp.array[Phi],
        tool: wp.array2d[wp.vec3],
        xs: wp.array3d[wp.vec3],
        vs: wp.array3d[wp.vec3],
        Cs: wp.array3d[wp.mat33],
        Fs: wp.array3d[wp.mat33],
        x_bar: wp.array2d[wp.vec3],
        v_bar: wp.array2d[wp.vec3],
        C_bar: wp.array2d[wp.mat33],
        F_bar: wp.array2d[wp.mat33],
        phi_bar: wp.array[Phi],
        tool_bar: wp.array2d[wp.vec3],
        grid: wp.array2d[wp.vec4],
        velocity: wp.array2d[wp.vec4],
        touches: wp.array2d[wp.vec4],
        grid_bar: wp.array2d[wp.vec4],
        touches_bar: wp.array2d[wp.vec4],
        active: wp.array2d[wp.int32],
        active_count: wp.array[wp.int32],
    ):
        """The adjoint of `advance`: turns the cotangents of the last state into those of the first, of phi and tool."""
        b = first + stride * wp.tid()
        slot = first
        phi = phis[b]
        phi_sum = Phi()
        for back in range(steps):
            s = steps - 1 - back
            substep(k, phi, b, s, tool, s, s + 1, slot, xs, vs, Cs, Fs, grid, velocity, touches, active, active_count)
            for p in range(xs.shape[2]):
                x = xs[b, s, p]
                if inside(k, x):
                    v_total = v_bar[b, p] + k.dt * x_bar[b, p]
                    x_bar[b, p] = x_bar[b, p] + gather_adjoint(k, x, v_total, C_bar[b, p], slot, velocity, grid_bar)
            tip = tool[b, s]
            tip_v = tip_velocity(k, tool, b, s)
            tip_sum = wp.vec3()
            tip_v_sum = wp.vec3()
            for n in range(active_count[slot]):
                i = active[slot, n]
                u = grid_bar[slot, i]
                _k, node_phi, node_bar, touch_bar, _x, node_tip_v, _v = wp.grad(node_work)(
                    k, phi, grid[slot, i], touches[slot, i], node_position(k, i), tip_v, wp.vec3(u[0], u[1], u[2])
                )
                grid_bar[slot, i] = node_bar
                touches_bar[slot, i] = touch_bar
                phi_sum += node_phi
                tip_v_sum += node_tip_v
            for p in range(xs.shape[2]):
                x = xs[b, s, p]
                if inside(k, x):
                    v = vs[b, s, p]
                    C = Cs[b, s, p]
                    F = Fs[b, s, p]
                    momentum, affine, touch, _F = particle_forward(k, phi, x, v, C, F, tip)
                    momentum_bar, affine_bar, mass_x = scatter_adjoint(k, x, momentum, affine, slot, grid_bar)
                    touch_bar, touch_x = scatter_touch_adjoint(k, x, touch, slot, touches_bar)
                    _k, p_phi, p_x, p_v, p_C, p_F, p_tip, _m, _a, _t, _f = wp.grad(particle_work)(
                        k, phi, x, v, C, F, tip, momentum_bar, affine_bar, touch_bar, F_bar[b, p]
                    )
                    x_bar[b, p] = x_bar[b, p] + mass_x + touch_x + p_x
                    v_bar[b, p] = p_v
                    C_bar[b, p] = p_C
                    F_bar[b, p] = p_F
                    phi_sum += p_phi
                    tip_sum += p_tip
            tool_bar[b, s] = tool_bar[b, s] + tip_sum - tip_v_sum / k.dt
            tool_bar[b, s + 1] = tool_bar[b, s + 1] + tip_v_sum / k.dt
            for n in range(active_count[slot]):
                grid[slot, active[slot, n]] = wp.vec4()
                grid_bar[slot, active[slot, n]] = wp.vec4()
                touches[slot, active[slot, n]] = wp.vec4()
                touches_bar[slot, active[slot, n]] = wp.vec4()
            active_count[slot] = 0
        phi_bar[b] = phi_sum

    @wp.kernel(module=module)
    def keep_adjoints(
        k: Constants, phis: wp.array[Phi], x: wp.array[wp.vec3], C: wp.array[wp.mat33], out: wp.array[float]
    ):
        """Never launched: Warp emits the adjoints of nested functions only where a differentiable kernel calls them."""
        a, A = x[0], C[0]
        node = wp.vec4(a[0], a[1], a[2], 1.0)
        out[0] = node_work(k, phis[0], node, node, a, a, a) + particle_work(k, phis[0], a, a, A, A, a, a, A, node, A)

    return Kernels(phi_type=Phi, advance=advance, retreat=retreat)
