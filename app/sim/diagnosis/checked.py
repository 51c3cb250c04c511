"""Simulators with diagnosis: of their input before they run, and of a failure afterwards."""

from pathlib import Path

import jax
import numpy as np
from jaxtyping import Float, Int

from app.core.errors import SimulationError
from app.sim.diagnosis.dump import Dump, leave_dump
from app.sim.diagnosis.failure_diagnosis import MpmCase, single
from app.sim.diagnosis.rod_failure_diagnosis import RodCase, single_rod
from app.sim.rods.checks import RodSetup, require_rod_inputs
from app.sim.rods.domain import are_whole
from app.sim.rods.effect import RodSetting
from app.sim.rods.rollout import RodPhysics, SimulateRod, complete, make_rod_rollout
from app.sim.rods.state import RodState
from app.sim.runtime.checks import Setup, first, require_inputs
from app.sim.runtime.rollout import Simulate, make_rollout
from app.sim.state import Setting, State


def with_checks(setup: Setup, folder: Path, simulate: Simulate | None = None) -> Simulate:
    """`simulate`, by default a new simulator of `setup`, for use outside of `jax.jit`.

    Raises ParameterError for input that no simulation can begin with, and SimulationError where a candidate did not
    stay finite; that one's dump then lies in `folder`, and the message says what happened.
    """
    run = simulate or make_rollout(setup.scene, particle_count=setup.counts, effects=setup.effects)

    def simulate_checked(
        phi: Float[jax.Array, "B P"],
        state: State,
        tool: Float[jax.Array, "B T A"],
        setting: Setting | None = None,
    ) -> State:
        known = setting or Setting.unknown(phi.shape[0], sum(setup.counts))
        require_inputs(setup, phi, state, tool, known)
        end = run(phi, state, tool, known)
        broken = first(~np.isfinite(np.asarray(end.x)))
        if broken is None:
            return end
        case = single(setup, phi, state, tool, known, candidate=broken[0])
        raise _candidate_error(case, folder, broken[0], phi.shape[0])

    return simulate_checked


def checked_rods(setup: RodSetup, folder: Path, simulate: SimulateRod | None = None) -> SimulateRod:
    """The same for rods, of which a candidate also fails that ends strained by half or farther away than the room."""
    run = simulate or make_rod_rollout(setup.scene, setup.effects)

    def simulate_checked(
        physics: RodPhysics,
        state: RodState,
        tool: Float[jax.Array, "B T 3"],
        phi: Float[jax.Array, "B P"] | None = None,
        setting: RodSetting | None = None,
        spans: Int[jax.Array, "B 2"] | None = None,
    ) -> RodState:
        own, known = complete(setup.scene, setup.effects, len(tool), phi, setting)
        require_rod_inputs(setup, physics, own, state, tool, known)
        end = run(physics, state, tool, own, known, spans)
        broken = first(~np.asarray(are_whole(setup.scene, end.nodes)))
        if broken is None:
            return end
        case = single_rod(setup, physics, state, tool, own, known, candidate=broken[0])
        raise _candidate_error(case, folder, broken[0], len(tool))

    return simulate_checked


def _candidate_error(case: MpmCase | RodCase, folder: Path, candidate: int, count: int) -> SimulationError:
    """The error of a candidate that did not stay finite, whose dump is left in `folder`."""
    path = leave_dump(folder, Dump(case=case, about=f"candidate {candidate} of {count}"))
    return SimulationError(
        f"Candidate {candidate} of {count}: {case.dissect().verdict()} `dipac replay {path}` shows it."
    )
