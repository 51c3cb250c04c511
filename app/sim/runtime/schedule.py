"""Launch schedules of an action's kernels: their order, and their threads."""

# Warp's arrays and structs are untyped.
# pyright: reportAttributeAccessIssue=false, reportGeneralTypeIssues=false

from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, final

import jax
import warp as wp

from app.sim.codegen.kernel_codegen import Code
from app.sim.codegen.tool_composition import parts
from app.sim.constants import Constants
from app.sim.effects.base import Effect
from app.sim.model.scene import Scene
from app.sim.mpm.action_kernels import RESIDENT, ActionKernels, action_kernels
from app.sim.mpm.candidate_kernels import CandidateKernels, candidate_kernels
from app.sim.mpm.memory import Grid, GridBars
from app.sim.mpm.particle_kernels import (
    BLOCK_DIM,
    SLOTS,
    SLOTS_BACK,
    WARP_SIZE,
    ParticleKernels,
    particle_kernels,
)
from app.sim.mpm.substep import KernelFunctions
from app.sim.runtime.threads import core_count, run_jobs

LANES = 1024
"""Threads a candidate for the nodes on a GPU: a rope of 0.4 m has about 1300 nodes in its blocks."""


class Work(NamedTuple):
    """Working set of an action: constants, `inputs.Types.Inputs`, history and grid."""

    k: Constants
    inputs: Any
    history: wp.array4d[wp.vec4]
    grid: Grid


class Bars(NamedTuple):
    """Cotangents: of the state, turned from last to first in place; of phi, in partial sums; of tool; of the grid."""

    state: wp.array4d[wp.vec4]
    phi_grain: wp.array2d[Any]
    phi_node: wp.array2d[Any]
    tool: wp.array2d[Any]
    grid: GridBars


class Schedule(Protocol):
    """Launch strategy of the kernels."""

    @property
    def pieces(self) -> KernelFunctions:
        """Code and types that its kernels share."""
        ...

    @property
    def modules(self) -> tuple[wp.Module, ...]:
        """All that may be launched."""
        ...

    @property
    def sorts(self) -> bool:
        """True if it is faster when particles that are neighbours in memory are so in space."""
        ...

    def module(self, candidates: int, particles: int, *, backwards: bool) -> wp.Module:
        """The one whose kernels actions of this size need, forward or turned back."""
        ...

    def lists(self, candidates: int) -> int:
        """Number of candidates in work at the same time, each with a list of active blocks."""
        ...

    def slots(self, candidates: int, *, backwards: bool) -> int:
        """Number of grids in use at the same time."""
        ...

    def columns(self, candidates: int, particles: int) -> tuple[int, int]:
        """Numbers of partial sums of a candidate's parameter cotangents, over particles and over nodes."""
        ...

    def forward(self, work: Work, start: wp.array4d[wp.vec4]) -> None:
        """Fill the history. The grid is given empty."""
        ...

    def adjoint(self, work: Work, bars: Bars) -> None:
        """Fill `bars` from a full history. The grids are given empty, the sums as zeros."""
        ...


@final
@dataclass(frozen=True, kw_only=True)
class ThreadedCandidates:
    """CPU schedule: one launch a candidate; a thread takes the next when it is done, as cores are rarely equal."""

    kernels: CandidateKernels
    threads: int = field(default_factory=core_count)
    sorts: bool = False

    @property
    def pieces(self) -> KernelFunctions:
        """Those of whole actions of a candidate."""
        return self.kernels.pieces

    @property
    def modules(self) -> tuple[wp.Module, ...]:
        """Forward and adjoint."""
        return self.kernels.modules

    def module(self, candidates: int, particles: int, *, backwards: bool) -> wp.Module:
        """One for each direction, whatever the size."""
        del candidates, particles
        return self.kernels.modules[backwards]

    def lists(self, candidates: int) -> int:
        """Lists in use at once: one per thread."""
        return min(self.threads, candidates)

    def slots(self, candidates: int, *, backwards: bool) -> int:
        """Grids in use at once: one per thread."""
        del backwards
        return self.lists(candidates)

    def columns(self, candidates: int, particles: int) -> tuple[int, int]:
        """One each: a thread adds up its candidate's."""
        del candidates, particles
        return 1, 1

    def forward(self, work: Work, start: wp.array4d[wp.vec4]) -> None:
        """One launch a candidate."""
        self._launch(self.kernels.forward, work, [start, work.history, work.grid])

    def adjoint(self, work: Work, bars: Bars) -> None:
        """One launch a candidate."""
        sums = [bars.state, bars.phi_grain, bars.phi_node, bars.tool]
        self._launch(self.kernels.adjoint, work, [work.history, *sums, work.grid, bars.grid])

    def _launch(self, kernel: wp.Kernel, work: Work, arguments: list[Any]) -> None:
        def simulate(b: int, slot: int) -> None:
            wp.launch(kernel, 1, [work.k, work.inputs, b, slot, *arguments], device=work.history.device)

        run_jobs(work.history.shape[0], self.threads, simulate)


@final
@dataclass(frozen=True, kw_only=True)
class Launched:
    """CUDA schedule: one launch an action where all its threads are on the GPU at the same time, or two a substep.

    `actions`: kernels of whole actions, the best first. `multiprocessors`: those of the smallest GPU; with none, no
    action is one launch. `lanes` threads a candidate take its active nodes where a substep is two launches.
    """

    substeps: ParticleKernels
    actions: tuple[ActionKernels, ...]
    multiprocessors: int
    lanes: int = LANES
    sorts: bool = True

    @property
    def pieces(self) -> KernelFunctions:
        """Those of any of the kernels."""
        return self.substeps.pieces

    @property
    def modules(self) -> tuple[wp.Module, ...]:
        """All."""
        return (*(module for kernels in self.actions for module in kernels.modules), *self.substeps.modules)

    def module(self, candidates: int, particles: int, *, backwards: bool) -> wp.Module:
        """That of whole actions, where they fit."""
        whole = self.back(candidates, particles)[0] if backwards else self.forth(candidates, particles)
        return whole.modules[backwards] if whole else self.substeps.modules[0]

    def forth(self, candidates: int, particles: int) -> ActionKernels | None:
        """The first kernels of whole actions whose blocks are all on the GPU at the same time."""
        return self._fitting(candidates, particles)

    def back(self, candidates: int, particles: int) -> tuple[ActionKernels | None, int]:
        """The same of adjoints, and 2 if there is room for threads of their own to compute the grid again, else 1."""
        apart = self._fitting(2 * candidates, particles)
        return (apart, 2) if apart else (self._fitting(candidates, particles), 1)

    def _fitting(self, candidates: int, particles: int) -> ActionKernels | None:
        room = RESIDENT * self.multiprocessors
        return next((each for each in self.actions if candidates * each.blocks(particles) <= room), None)

    def lists(self, candidates: int) -> int:
        """All."""
        return candidates

    def slots(self, candidates: int, *, backwards: bool) -> int:
        """Several a candidate: substeps overlap."""
        return candidates * (SLOTS_BACK if backwards else SLOTS)

    def columns(self, candidates: int, particles: int) -> tuple[int, int]:
        """One for each warp of threads: atomic sums on one address would queue."""
        whole, _ = self.back(candidates, particles)
        if whole:
            warps = whole.blocks(particles) * BLOCK_DIM // WARP_SIZE
            return warps, warps
        return -(-particles // WARP_SIZE), self.lanes // WARP_SIZE

    def forward(self, work: Work, start: wp.array4d[wp.vec4]) -> None:
        """One launch, or particles and nodes in turn."""
        k, inputs, history, grid = work
        candidates, _, _, particles = history.shape
        whole = self.forth(candidates, particles)
        if whole:
            blocks = whole.blocks(particles)
            _launch(whole.forward, work, blocks * BLOCK_DIM, [k, blocks, inputs, start, history, grid])
            return
        steps = inputs.tool.shape[1] - 1
        for s in range(steps):
            self._over_particles(self.substeps.particles, work, [k, s, inputs, start, history, grid])
            self._over_nodes(self.substeps.nodes, work, [k, s, self.lanes, inputs, grid], groups=2)
        self._over_particles(self.substeps.particles, work, [k, steps, inputs, start, history, grid])

    def adjoint(self, work: Work, bars: Bars) -> None:
        """The same backwards, the grid computed again one substep ahead by threads of their own."""
        k, inputs, history, grid = work
        candidates, _, _, particles = history.shape
        whole, groups = self.back(candidates, particles)
        if whole:
            own = whole.blocks(particles)
            blocks = groups * own
            sums = [bars.state, bars.phi_grain, bars.phi_node, bars.tool]
            arguments = [k, blocks, own * BLOCK_DIM, inputs, history, *sums, grid, bars.grid]
            _launch(whole.adjoint, work, blocks * BLOCK_DIM, arguments)
            return
        of_particles = [_warps(particles), inputs, history, bars.state, bars.phi_grain, bars.tool, grid, bars.grid]
        of_nodes = [self.lanes, inputs, bars.phi_node, grid, bars.grid]
        for s in reversed(range(inputs.tool.shape[1])):
            self._over_particles(self.substeps.particles_adjoint, work, [k, s, *of_particles], groups=2)
            self._over_nodes(self.substeps.nodes_adjoint, work, [k, s, *of_nodes], groups=3)
        self._over_particles(self.substeps.particles_adjoint, work, [k, -1, *of_particles])

    def _over_particles(self, kernel: wp.Kernel, work: Work, arguments: list[Any], groups: int = 1) -> None:
        _launch(kernel, work, groups * _warps(work.history.shape[3]), arguments)

    def _over_nodes(self, kernel: wp.Kernel, work: Work, arguments: list[Any], groups: int) -> None:
        _launch(kernel, work, groups * self.lanes, arguments)


def _warps(particles: int) -> int:
    """Threads of whole warps, at least one a particle."""
    return -(-particles // WARP_SIZE) * WARP_SIZE


def _launch(kernel: wp.Kernel, work: Work, threads: int, arguments: list[Any]) -> None:
    """Launch so many threads a candidate."""
    dim = (work.history.shape[0], threads)
    wp.launch(kernel, dim, arguments, device=work.history.device, block_dim=BLOCK_DIM)


def code_of(scene: Scene, effects: tuple[Effect, ...]) -> Code:
    """Compile-time part of a scene."""
    primitives, _, coordinates = parts(scene.tools)
    laws = tuple(body.material.law for body in scene.bodies)
    return Code(laws=laws, parts=primitives, coordinates=coordinates, effects=effects)


def schedule_for(platform: str, scene: Scene, effects: tuple[Effect, ...]) -> Schedule:
    """The one that suits JAX's platform of that name."""
    code = code_of(scene, effects)
    if platform == "cpu":
        return ThreadedCandidates(kernels=candidate_kernels(code))
    wp.config.log_level = wp.LOG_WARNING  # Warp announces itself on stdout, which belongs to the command line.
    return Launched(
        substeps=particle_kernels(code),
        actions=tuple(action_kernels(code, by_planes=by_planes) for by_planes in (True, False)),
        multiprocessors=min(wp.device_from_jax(each).sm_count for each in jax.local_devices()),
    )
