"""Launch schedules of an action's kernels: their order, and their threads."""

# Warp's arrays and structs are untyped.
# pyright: reportAttributeAccessIssue=false, reportGeneralTypeIssues=false

from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, final

import warp as wp

from app.sim.codegen.kernel_codegen import Code
from app.sim.codegen.tool_composition import parts
from app.sim.constants import Constants
from app.sim.effects.base import Effect
from app.sim.model.scene import Scene
from app.sim.mpm.action_kernels import ActionKernels, action_kernels
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
from app.sim.runtime.threads import core_count, run_jobs

LANES = 1024
"""Threads a candidate for the nodes on a GPU: a rope of 0.4 m has about 1300 nodes in its blocks."""


import os
LEAST_THREADS = int(os.environ.get("LT", "512"))
"""Threads a candidate at least, for its nodes."""


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
    def kernels(self) -> CandidateKernels | ParticleKernels | ActionKernels:
        """Kernels to launch."""
        ...

    @property
    def sorts(self) -> bool:
        """True if it is faster when particles that are neighbours in memory are so in space."""
        ...

    def lists(self, candidates: int) -> int:
        """Number of candidates in work at the same time, each with a list of active blocks."""
        ...

    def slots(self, candidates: int, *, backwards: bool) -> int:
        """Number of grids in use at the same time."""
        ...

    def grain_columns(self, particles: int) -> int:
        """The number of partial sums of a candidate's parameter cotangents over particles."""
        ...

    def node_columns(self, particles: int) -> int:
        """The number of partial sums over nodes."""
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

    def lists(self, candidates: int) -> int:
        """Lists in use at once: one per thread."""
        return min(self.threads, candidates)

    def slots(self, candidates: int, *, backwards: bool) -> int:
        """Grids in use at once: one per thread."""
        del backwards
        return self.lists(candidates)

    def grain_columns(self, particles: int) -> int:
        """One: a thread adds up its candidate's."""
        del particles
        return 1

    def node_columns(self, particles: int) -> int:
        """One."""
        del particles
        return 1

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
class LaunchedSubsteps:
    """CUDA schedule: two launches a substep, a thread a particle, `lanes` threads a candidate for its active nodes."""

    kernels: ParticleKernels
    lanes: int = LANES
    sorts: bool = True

    def lists(self, candidates: int) -> int:
        """All."""
        return candidates

    def slots(self, candidates: int, *, backwards: bool) -> int:
        """Several a candidate: substeps overlap."""
        return candidates * (SLOTS_BACK if backwards else SLOTS)

    def grain_columns(self, particles: int) -> int:
        """One for each warp of threads: atomic sums on one address would queue."""
        return -(-particles // WARP_SIZE)

    def node_columns(self, particles: int) -> int:
        """Likewise."""
        del particles
        return self.lanes // WARP_SIZE

    def forward(self, work: Work, start: wp.array4d[wp.vec4]) -> None:
        """Particles and nodes in turn."""
        k, inputs, history, grid = work
        steps = inputs.tool.shape[1] - 1
        for s in range(steps):
            self._over_particles(self.kernels.particles, work, [k, s, inputs, start, history, grid])
            self._over_nodes(self.kernels.nodes, work, [k, s, self.lanes, inputs, grid], groups=2)
        self._over_particles(self.kernels.particles, work, [k, steps, inputs, start, history, grid])

    def adjoint(self, work: Work, bars: Bars) -> None:
        """The same backwards, the grid computed again one substep ahead by threads of their own."""
        k, inputs, history, grid = work
        threads = WARP_SIZE * self.grain_columns(history.shape[3])
        particles = [threads, inputs, history, bars.state, bars.phi_grain, bars.tool, grid, bars.grid]
        nodes = [self.lanes, inputs, bars.phi_node, grid, bars.grid]
        for s in reversed(range(inputs.tool.shape[1])):
            self._over_particles(self.kernels.particles_adjoint, work, [k, s, *particles], groups=2)
            self._over_nodes(self.kernels.nodes_adjoint, work, [k, s, *nodes], groups=3)
        self._over_particles(self.kernels.particles_adjoint, work, [k, -1, *particles])

    def _over_particles(self, kernel: wp.Kernel, work: Work, arguments: list[Any], groups: int = 1) -> None:
        threads = WARP_SIZE * self.grain_columns(work.history.shape[3])
        self._launch(kernel, work, groups * threads, arguments)

    def _over_nodes(self, kernel: wp.Kernel, work: Work, arguments: list[Any], groups: int) -> None:
        self._launch(kernel, work, groups * self.lanes, arguments)

    def _launch(self, kernel: wp.Kernel, work: Work, threads: int, arguments: list[Any]) -> None:
        dim = (work.history.shape[0], threads)
        wp.launch(kernel, dim, arguments, device=work.history.device, block_dim=BLOCK_DIM)


@final
@dataclass(frozen=True, kw_only=True)
class LaunchedActions:
    """CUDA schedule: one launch an action, whose blocks wait for those of the same candidate twice a substep."""

    kernels: ActionKernels
    least_threads: int = LEAST_THREADS
    sorts: bool = True

    def lists(self, candidates: int) -> int:
        """All."""
        return candidates

    def slots(self, candidates: int, *, backwards: bool) -> int:
        """Several a candidate: substeps overlap."""
        return candidates * (SLOTS_BACK if backwards else SLOTS)

    def grain_columns(self, particles: int) -> int:
        """One for each warp of threads: atomic sums on one address would queue."""
        return self._blocks(particles) * BLOCK_DIM // WARP_SIZE

    def node_columns(self, particles: int) -> int:
        """Likewise."""
        return self.grain_columns(particles)

    def forward(self, work: Work, start: wp.array4d[wp.vec4]) -> None:
        """One launch."""
        k, inputs, history, grid = work
        blocks = self._blocks(history.shape[3])
        self._launch(self.kernels.forward, work, blocks, [k, blocks, inputs, start, history, grid])

    def adjoint(self, work: Work, bars: Bars) -> None:
        """One launch, of twice as many blocks: a half of them computes the grid again, one substep ahead."""
        k, inputs, history, grid = work
        blocks = 2 * self._blocks(history.shape[3])
        sums = [bars.state, bars.phi_grain, bars.phi_node, bars.tool]
        self._launch(self.kernels.adjoint, work, blocks, [k, blocks, inputs, history, *sums, grid, bars.grid])

    def _blocks(self, particles: int) -> int:
        return -(-max(particles, self.least_threads) // BLOCK_DIM)

    def _launch(self, kernel: wp.Kernel, work: Work, blocks: int, arguments: list[Any]) -> None:
        dim = (work.history.shape[0], blocks * BLOCK_DIM)
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
    if os.environ.get("OLD"):
        return LaunchedSubsteps(kernels=particle_kernels(code))
    return LaunchedActions(kernels=action_kernels(code))
