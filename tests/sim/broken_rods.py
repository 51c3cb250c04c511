"""Rods that are sound, and others that break."""

import jax
import jax.numpy as jnp
import numpy as np

from app.sim.diagnosis.rod_failure_diagnosis import RodCase, single_rod
from app.sim.rods.checks import RodSetup
from app.sim.rods.effect import RodSetting
from app.sim.rods.rollout import RodPhysics, make_rod_rollout
from app.sim.rods.scene import RodScene
from app.sim.rods.state import RodState

SCENE = RodScene(length_m=0.40, radius_m=0.008, mass_kg=0.064, finger_radius_m=0.009)
SETUP = RodSetup(scene=SCENE, effects=())
ROLLOUT = make_rod_rollout(SCENE)
STEPS = 200
SPEED_M_S = 0.2


def path(start: tuple[float, float] = (0.02, -0.03), speed_m_s: float = SPEED_M_S, steps: int = STEPS) -> np.ndarray:
    """Path (T, 3) of a finger towards larger y."""
    y = start[1] + speed_m_s * SCENE.dt_s * np.arange(steps + 1)
    return np.stack([np.full(len(y), start[0]), y, np.full(len(y), 0.006)], axis=1).astype(np.float32)


def straight(heading_rad: float = 0.0) -> np.ndarray:
    """Nodes (2, n) of a straight rope about the origin."""
    along = SCENE.rest_m * (np.arange(SCENE.nodes) - SCENE.nodes // 2)
    return np.stack([along * np.cos(heading_rad), along * np.sin(heading_rad)])


Given = tuple[RodPhysics, np.ndarray, RodState, np.ndarray, RodSetting]
"""Physics, phi, state, tool and setting, as `require_rod_inputs` takes them."""


def problem(tool: np.ndarray | None = None, lines: tuple[np.ndarray, ...] = ()) -> Given:
    """Two candidates of a rope that a finger pushes; all of it sound, and to be written into."""
    way = path() if tool is None else tool
    state = RodState.along(jnp.asarray(np.stack(lines or (straight(), straight(0.1)))))
    given = RodPhysics.nominal(SCENE, 2), jnp.zeros((2, 0)), state, jnp.stack([way, way])
    return jax.tree.map(np.array, (*given, RodSetting.unknown(2, SCENE.nodes)))


def case_of(given: Given, candidate: int = 0, setup: RodSetup = SETUP) -> RodCase:
    """One of the candidates as a case."""
    physics, phi, state, tool, setting = given
    return single_rod(setup, physics, state, tool, phi, setting, candidate=candidate)


def too_stiff() -> RodCase:
    """A rope of four hundred times the rigidity that its time steps bear."""
    given = problem()
    given[0].rigidity[1] *= 1600
    return case_of(given, 1)


def simulated(given: Given) -> RodState:
    """State at the end by the ordinary simulator."""
    physics, phi, state, tool, setting = jax.tree.map(jnp.asarray, given)
    return ROLLOUT(physics, state, tool, phi, setting)


def is_first_bad_step(case: RodCase, steps: int | None) -> bool:
    """True if the simulator is finite after `steps` - 1 steps and not after `steps`; for None, finite to the end."""
    if steps is None:
        return bool(np.isfinite(simulated((*_start(case), case.tool, case.setting)).nodes).all())
    ends = [simulated((*_start(case), case.tool[:, : count + 1], case.setting)).nodes for count in (steps - 1, steps)]
    return [bool(np.isfinite(end).all()) for end in ends] == [True, False]


def _start(case: RodCase) -> tuple[RodPhysics, np.ndarray, RodState]:
    return case.physics, case.phi, case.state
