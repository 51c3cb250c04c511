"""In which order, and in how many threads, the kernels of an action are launched."""

# Warp's arrays and structs are untyped.
# pyright: reportAttributeAccessIssue=false, reportGeneralTypeIssues=false

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, final

import warp as wp

from app.sim.constants import Constants
from app.sim.effects.base import Effect
from app.sim.kernels import CandidateKernels, ParticleKernels, candidate_kernels, particle_kernels
from app.sim.memory import Grid, GridBars, History, Particles

LANES = 512
"""Threads a candidate for the nodes on a GPU: about ten nodes each for a rope of 2000 particles."""


class Work(NamedTuple):
    """What an action is computed from and in: constants, phi (B,), tool (B, T), history and grid."""

    k: Constants
    phi: wp.array[Any]
    tool: wp.array2d[wp.vec3]
    history: History
    grid: Grid


class Bars(NamedTuple):
    """Cotangents: of the state, turned from last to first in place; of phi, in partial sums; of tool; of the grid."""

    state: Particles
    phi: wp.array2d[Any]
    tool: wp.array2d[wp.vec3]
    grid: GridBars


class Schedule(Protocol):
    """How the kernels are launched."""

    @property
    def kernels(self) -> CandidateKernels | ParticleKernels:
        """What is launched."""
        ...

    def slots(self, candidates: int) -> int:
        """How many candidates are in work at the same time, each with a grid of its own."""
        ...

    def phi_columns(self, particles: int) -> int:
        """The number of partial sums of a candidate's parameter cotangents."""
        ...

    def forward(self, work: Work, start: Particles) -> None:
        """Fill the history. The grid is given and left empty."""
        ...

    def adjoint(self, work: Work, bars: Bars) -> None:
        """Fill `bars` from a full history. The grids are given and left empty, the sums given as zeros."""
        ...


@final
@dataclass(frozen=True, kw_only=True)
class ThreadedCandidates:
    """For the CPU: one launch a candidate; a thread that has ended one takes the next, for cores are rarely equal."""

    kernels: CandidateKernels
    threads: int = field(default_factory=lambda: len(os.sched_getaffinity(0)))

    def slots(self, candidates: int) -> int:
        """As many as there are threads."""
        return min(self.threads, candidates)

    def phi_columns(self, particles: int) -> int:
        """One: a thread adds up its candidate's."""
        del particles
        return 1

    def forward(self, work: Work, start: Particles) -> None:
        """One launch a candidate."""
        _k, phi, tool, history, grid = work
        self._launch(self.kernels.forward, work, [phi, tool, start, history, grid])

    def adjoint(self, work: Work, bars: Bars) -> None:
        """One launch a candidate."""
        _k, phi, tool, history, grid = work
        self._launch(self.kernels.adjoint, work, [phi, tool, history, bars.state, bars.phi, bars.tool, grid, bars.grid])

    def _launch(self, kernel: wp.Kernel, work: Work, arguments: list[Any]) -> None:
        candidates = work.phi.shape[0]
        threads = self.slots(candidates)
        waiting = iter(range(candidates))  # Shared: the interpreter lock makes taking the next one atomic.

        def simulate(slot: int) -> None:
            for b in waiting:
                wp.launch(kernel, 1, [work.k, b, slot, *arguments], device="cpu")

        if threads == 1:
            simulate(0)
            return
        with ThreadPoolExecutor(threads) as pool:  # Launches release the interpreter lock.
            list(pool.map(simulate, range(threads)))


@final
@dataclass(frozen=True, kw_only=True)
class LaunchedSubsteps:
    """For CUDA: a few launches a substep, a thread a particle, and `lanes` threads a candidate for its active nodes."""

    kernels: ParticleKernels
    lanes: int = LANES

    def slots(self, candidates: int) -> int:
        """All."""
        return candidates

    def phi_columns(self, particles: int) -> int:
        """One a thread: atomic sums on one address would queue."""
        return self.lanes + particles

    def forward(self, work: Work, start: Particles) -> None:
        """Four launches a substep."""
        k, _, _, history, grid = work
        self._over_particles(self.kernels.start, work, [start, history])
        for s in range(work.tool.shape[1] - 1):
            self._to_grid(work, s)
            self._over_particles(self.kernels.grid_to_particles, work, [k, s, history, grid])
            self._over_nodes(self.kernels.clear, work, [self.lanes, grid])
            grid.count.zero_()

    def adjoint(self, work: Work, bars: Bars) -> None:
        """Six launches a substep, the grid computed again."""
        (k, phi, tool, history, grid), kernels, lanes = work, self.kernels, self.lanes
        for s in reversed(range(tool.shape[1] - 1)):
            self._to_grid(work, s)
            arguments = [k, s, history, bars.state, grid, bars.grid]
            self._over_particles(kernels.grid_to_particles_adjoint, work, arguments)
            arguments = [k, s, lanes, phi, tool, bars.phi, bars.tool, grid, bars.grid]
            self._over_nodes(kernels.grid_adjoint, work, arguments)
            arguments = [k, s, lanes, phi, tool, history, bars.state, bars.phi, bars.tool, bars.grid]
            self._over_particles(kernels.particles_to_grid_adjoint, work, arguments)
            self._over_nodes(kernels.clear_adjoint, work, [lanes, grid, bars.grid])
            grid.count.zero_()

    def _to_grid(self, work: Work, s: int) -> None:
        k, phi, tool, history, grid = work
        self._over_particles(self.kernels.particles_to_grid, work, [k, s, phi, tool, history, grid])
        self._over_nodes(self.kernels.grid, work, [k, s, self.lanes, phi, tool, grid])

    def _over_particles(self, kernel: wp.Kernel, work: Work, arguments: list[Any]) -> None:
        candidates, _, particles = work.history.x.shape
        wp.launch(kernel, (candidates, particles), arguments, device=work.phi.device)

    def _over_nodes(self, kernel: wp.Kernel, work: Work, arguments: list[Any]) -> None:
        wp.launch(kernel, (work.phi.shape[0], self.lanes), arguments, device=work.phi.device)


def schedule_for(platform: str, effects: tuple[Effect, ...]) -> Schedule:
    """The one that suits JAX's platform of that name."""
    if platform == "cpu":
        return ThreadedCandidates(kernels=candidate_kernels(effects))
    return LaunchedSubsteps(kernels=particle_kernels(effects))
