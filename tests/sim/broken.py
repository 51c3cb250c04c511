"""A rope that is sound, and one that flies off the grid."""

import jax
import jax.numpy as jnp
import numpy as np

from app.sim.diagnosis.failure_diagnosis import MpmCase, single
from app.sim.model.params import nominal_phi
from app.sim.runtime.checks import Setup
from app.sim.state import Setting, State
from tests.sim.scenes import PARTICLES, SCENE, rope, straight_tool

STEPS = 40
SETUP = Setup(scene=SCENE, counts=(PARTICLES,), effects=())
BESIDE = straight_tool((0.51, -0.03, 0.005), (0.0, 0.2, 0.0), STEPS)


def problem(tool: np.ndarray = BESIDE) -> tuple[np.ndarray, State, np.ndarray, Setting]:
    """Two candidates of a rope beside the finger; all of it sound."""
    phi = np.stack([nominal_phi()[:2]] * 2)
    state = jax.tree.map(lambda leaf: np.array(leaf), State.at_rest(jnp.asarray(np.stack([rope(), rope(seed=1)]))))
    return phi, state, np.stack([tool, tool]), jax.tree.map(np.array, Setting.unknown(2, PARTICLES))


def flung(speed_m_s: float = 8.0) -> MpmCase:
    """One particle of candidate 1 flies towards the grid's side, a few cells away."""
    phi, state, tool, setting = problem()
    state.v[1, 30:, 1] = speed_m_s
    return single(SETUP, phi, state, tool, setting, candidate=1)
