"""The Warp kernels: whole actions, a thread a candidate, for the CPU; single substeps, a thread a particle, for CUDA.

Both call the same pieces (`app.sim.substep`). On the CPU a candidate's few active nodes stay in its core's cache, and
an action is one launch. On a GPU the launches of an action are recorded once, as a graph, by JAX.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportInvalidTypeForm=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportGeneralTypeIssues=false, reportUntypedFunctionDecorator=false
# pyright: reportAssignmentType=false, reportAttributeAccessIssue=false

import functools
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import warp as wp

from app.sim.constants import Constants
from app.sim.effects.base import Effect
from app.sim.memory import Grid, GridBars, History, Particles
from app.sim.physics import particle_work
from app.sim.substep import (
    GridOperation,
    clear,
    clear_bars,
    grid_operation,
    grid_to_particles,
    grid_to_particles_adjoint,
    particles_to_grid,
    particles_to_grid_adjoint,
    tip_velocity,
)


@final
@dataclass(frozen=True, kw_only=True)
class CandidateKernels:
    """Whole actions of candidate b in grid slot `slot`, one thread a launch."""

    module: wp.Module
    phi_type: type
    forward: wp.Kernel
    adjoint: wp.Kernel


@final
@dataclass(frozen=True, kw_only=True)
class ParticleKernels:
    """The parts of substep s; candidate b works in grid slot b. Launched over (B, N), and over (B, lanes) for nodes."""

    module: wp.Module
    phi_type: type
    start: wp.Kernel
    particles_to_grid: wp.Kernel
    grid: wp.Kernel
    grid_to_particles: wp.Kernel
    clear: wp.Kernel
    grid_to_particles_adjoint: wp.Kernel
    grid_adjoint: wp.Kernel
    particles_to_grid_adjoint: wp.Kernel
    clear_adjoint: wp.Kernel


def _module(kind: str, effects: Sequence[Effect], operation: GridOperation) -> wp.Module:
    """A module of its own for each kind of kernels, so that no platform compiles the other's.

    Warp emits the adjoints of nested functions only where a differentiable kernel calls them; it is put in here.
    """
    specs = repr([spec for effect in effects for spec in effect.parameters])
    module = wp.get_module(f"dipac_sim_{kind}_{hashlib.sha256(specs.encode()).hexdigest()[:8]}")
    Phi, work = operation.phi_type, operation.work

    @wp.kernel(module=module)
    def never_launched(
        k: Constants, phi: wp.array[Phi], x: wp.array[wp.vec3], C: wp.array[wp.mat33], out: wp.array[float]
    ):
        a, A = x[0], C[0]
        node = wp.vec4(a[0], a[1], a[2], 1.0)
        out[0] = work(k, phi[0], node, node, a, a, a) + particle_work(k, phi[0], a, a, A, A, a, a, A, node, A)

    return module


@functools.cache
def candidate_kernels(effects: tuple[Effect, ...]) -> CandidateKernels:
    """With these effects compiled in. Cheap: compilation happens at the first launch, or in warm-up."""
    operation = grid_operation(effects)
    module = _module("candidates", effects, operation)
    Phi, grid_forward, grid_adjoint = operation.phi_type, operation.forward, operation.adjoint

    @wp.func
    def to_grid(
        k: Constants,
        phi: Phi,
        tool: wp.array2d[wp.vec3],
        b: int,
        s: int,
        read: int,
        write: int,
        slot: int,
        h: History,
        grid: Grid,
    ):
        for p in range(h.x.shape[2]):
            particles_to_grid(k, phi, tool[b, s], b, p, read, write, slot, h, grid)
        for n in range(grid.count[slot]):
            grid_forward(k, phi, tip_velocity(k, tool, b, s), n, slot, grid)

    @wp.kernel(module=module, enable_backward=False)
    def forward(
        k: Constants,
        b: int,
        slot: int,
        phis: wp.array[Phi],
        tool: wp.array2d[wp.vec3],
        start: Particles,
        h: History,
        grid: Grid,
    ):
        for p in range(h.x.shape[2]):
            _copy_start(b, p, start, h)
        rows = h.x.shape[1]
        for s in range(tool.shape[1] - 1):
            read = s % rows
            write = (s + 1) % rows
            to_grid(k, phis[b], tool, b, s, read, write, slot, h, grid)
            for p in range(h.x.shape[2]):
                grid_to_particles(k, b, p, read, write, slot, h, grid)
            for n in range(grid.count[slot]):
                clear(n, slot, grid)
            grid.count[slot] = 0

    @wp.kernel(module=module, enable_backward=False)
    def adjoint(
        k: Constants,
        b: int,
        slot: int,
        phis: wp.array[Phi],
        tool: wp.array2d[wp.vec3],
        h: History,
        bars: Particles,
        phi_bar: wp.array2d[Phi],
        tool_bar: wp.array2d[wp.vec3],
        grid: Grid,
        grid_bars: GridBars,
    ):
        phi = phis[b]
        phi_sum = Phi()
        steps = tool.shape[1] - 1
        for back in range(steps):
            s = steps - 1 - back
            to_grid(k, phi, tool, b, s, s, s + 1, slot, h, grid)
            for p in range(h.x.shape[2]):
                grid_to_particles_adjoint(k, b, p, s, slot, h, bars, grid, grid_bars)
            tip_v = tip_velocity(k, tool, b, s)
            tip_v_sum = wp.vec3()
            for n in range(grid.count[slot]):
                phi_part, tip_v_part = grid_adjoint(k, phi, tip_v, n, slot, grid, grid_bars)
                phi_sum += phi_part
                tip_v_sum += tip_v_part
            tip_sum = wp.vec3()
            for p in range(h.x.shape[2]):
                phi_part, tip_part = particles_to_grid_adjoint(k, phi, tool[b, s], b, p, s, slot, h, bars, grid_bars)
                phi_sum += phi_part
                tip_sum += tip_part
            tool_bar[b, s] = tool_bar[b, s] + tip_sum - tip_v_sum / k.dt
            tool_bar[b, s + 1] = tool_bar[b, s + 1] + tip_v_sum / k.dt
            for n in range(grid.count[slot]):
                clear(n, slot, grid)
                clear_bars(n, slot, grid, grid_bars)
            grid.count[slot] = 0
        phi_bar[b, 0] = phi_sum

    return CandidateKernels(module=module, phi_type=Phi, forward=forward, adjoint=adjoint)


@wp.func
def _copy_start(b: int, p: int, start: Particles, h: History):
    h.x[b, 0, p] = start.x[b, p]
    h.v[b, 0, p] = start.v[b, p]
    h.C[b, 0, p] = start.C[b, p]
    h.F[b, 0, p] = start.F[b, p]


@functools.cache
def particle_kernels(effects: tuple[Effect, ...]) -> ParticleKernels:
    """With these effects compiled in. Cheap: compilation happens at the first launch, or in warm-up."""
    operation = grid_operation(effects)
    module = _module("particles", effects, operation)
    Phi, grid_forward, grid_adjoint = operation.phi_type, operation.forward, operation.adjoint
    kernel = wp.kernel(module=module, enable_backward=False)

    @kernel
    def start(start: Particles, h: History):
        b, p = wp.tid()
        _copy_start(b, p, start, h)

    @kernel
    def p2g(k: Constants, s: int, phis: wp.array[Phi], tool: wp.array2d[wp.vec3], h: History, grid: Grid):
        b, p = wp.tid()
        rows = h.x.shape[1]
        particles_to_grid(k, phis[b], tool[b, s], b, p, s % rows, (s + 1) % rows, b, h, grid)

    @kernel
    def grid(k: Constants, s: int, lanes: int, phis: wp.array[Phi], tool: wp.array2d[wp.vec3], grid: Grid):
        b, lane = wp.tid()
        for n in range(lane, grid.count[b], lanes):
            grid_forward(k, phis[b], tip_velocity(k, tool, b, s), n, b, grid)

    @kernel
    def g2p(k: Constants, s: int, h: History, grid: Grid):
        b, p = wp.tid()
        rows = h.x.shape[1]
        grid_to_particles(k, b, p, s % rows, (s + 1) % rows, b, h, grid)

    @kernel
    def clear_grid(lanes: int, grid: Grid):
        b, lane = wp.tid()
        for n in range(lane, grid.count[b], lanes):
            clear(n, b, grid)

    @kernel
    def g2p_adjoint(k: Constants, s: int, h: History, bars: Particles, grid: Grid, grid_bars: GridBars):
        b, p = wp.tid()
        grid_to_particles_adjoint(k, b, p, s, b, h, bars, grid, grid_bars)

    @kernel
    def grid_back(
        k: Constants,
        s: int,
        lanes: int,
        phis: wp.array[Phi],
        tool: wp.array2d[wp.vec3],
        phi_bar: wp.array2d[Phi],
        tool_bar: wp.array2d[wp.vec3],
        grid: Grid,
        grid_bars: GridBars,
    ):
        b, lane = wp.tid()
        phi_sum = Phi()
        tip_v_sum = wp.vec3()
        for n in range(lane, grid.count[b], lanes):
            phi_part, tip_v_part = grid_adjoint(k, phis[b], tip_velocity(k, tool, b, s), n, b, grid, grid_bars)
            phi_sum += phi_part
            tip_v_sum += tip_v_part
        phi_bar[b, lane] = phi_bar[b, lane] + phi_sum
        if wp.length_sq(tip_v_sum) != 0.0:  # Few nodes touch the finger; the others shall not queue for one address.
            wp.atomic_add(tool_bar, b, s, -tip_v_sum / k.dt)
            wp.atomic_add(tool_bar, b, s + 1, tip_v_sum / k.dt)

    @kernel
    def p2g_adjoint(
        k: Constants,
        s: int,
        lanes: int,
        phis: wp.array[Phi],
        tool: wp.array2d[wp.vec3],
        h: History,
        bars: Particles,
        phi_bar: wp.array2d[Phi],
        tool_bar: wp.array2d[wp.vec3],
        grid_bars: GridBars,
    ):
        b, p = wp.tid()
        phi_part, tip_part = particles_to_grid_adjoint(k, phis[b], tool[b, s], b, p, s, b, h, bars, grid_bars)
        phi_bar[b, lanes + p] = phi_bar[b, lanes + p] + phi_part
        if wp.length_sq(tip_part) != 0.0:
            wp.atomic_add(tool_bar, b, s, tip_part)

    @kernel
    def clear_all(lanes: int, grid: Grid, grid_bars: GridBars):
        b, lane = wp.tid()
        for n in range(lane, grid.count[b], lanes):
            clear(n, b, grid)
            clear_bars(n, b, grid, grid_bars)

    return ParticleKernels(
        module=module,
        phi_type=Phi,
        start=start,
        particles_to_grid=p2g,
        grid=grid,
        grid_to_particles=g2p,
        clear=clear_grid,
        grid_to_particles_adjoint=g2p_adjoint,
        grid_adjoint=grid_back,
        particles_to_grid_adjoint=p2g_adjoint,
        clear_adjoint=clear_all,
    )
