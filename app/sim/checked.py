"""A simulator that says what is wrong: before it runs, and where it broke if it did."""

from pathlib import Path

import jax
import numpy as np
from jaxtyping import Float

from app.core.errors import SimulationError
from app.sim.autopsy import dissect, single
from app.sim.checks import Setup, first, require_inputs
from app.sim.dump import Dump, leave_dump
from app.sim.rollout import Simulate, make_rollout
from app.sim.state import Setting, State


def checked(setup: Setup, folder: Path, simulate: Simulate | None = None) -> Simulate:
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
        candidate, count = broken[0], phi.shape[0]
        case = single(setup, phi, state, tool, known, candidate=candidate)
        path = leave_dump(folder, Dump(case=case, about=f"candidate {candidate} of {count}"))
        raise SimulationError(
            f"Candidate {candidate} of {count}: {dissect(case).verdict()} `dipac replay {path}` shows it."
        )

    return simulate_checked
