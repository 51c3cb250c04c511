"""Ropes as rods that tests push with fingers, and slopes against differences."""

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from app.sim.rods.rollout import RodPhysics, SimulateRod
from app.sim.rods.scene import RodScene
from app.sim.rods.state import RodState

SCENE = RodScene(length_m=0.40, radius_m=0.008, mass_kg=0.064, finger_radius_m=0.009)
REACH_M = np.sqrt(0.017**2 - 0.007**2)
"""Distance [m] from the centreline to a touching finger whose tip is 6 mm above the table."""
Change = Callable[[float], tuple[RodPhysics, RodState, jax.Array]]
"""Physics, states and paths, changed by an amount."""


def headed(heading: np.ndarray, rest_m: float = SCENE.rest_m) -> np.ndarray:
    """Nodes (n, 2) of a line about the origin, whose segments have these headings [rad]."""
    line = np.concatenate([np.zeros((1, 2)), np.cumsum(np.stack([np.cos(heading), np.sin(heading)], 1), 0)])
    return rest_m * (line - line.mean(0))


def curve(turn_rad: float, scene: RodScene = SCENE) -> np.ndarray:
    """Nodes (n, 2) of an arc of constant curvature about the origin."""
    return headed(turn_rad * (np.arange(scene.nodes - 1) / (scene.nodes - 2) - 0.5), scene.rest_m)


def lying(*lines: np.ndarray) -> RodState:
    """Ropes (n, 2) each, as they are seen at rest, without particles of their own."""
    return RodState.along(jnp.asarray(np.stack(lines).transpose(0, 2, 1)))


def line_of(state: RodState, candidate: int = 0) -> np.ndarray:
    """Nodes (n, 2)."""
    return np.asarray(state.nodes[candidate, :2], np.float64).T


def straight(
    start: Sequence[float] | np.ndarray, velocity: Sequence[float] | np.ndarray, seconds: float, height_m: float = 0.006
) -> jax.Array:
    """A finger (1, T, 3) at constant velocity."""
    t = SCENE.dt_s * np.arange(round(seconds / SCENE.dt_s) + 1)
    path = np.stack([start[0] + velocity[0] * t, start[1] + velocity[1] * t, np.full(len(t), height_m)], axis=1)
    return jnp.asarray(path[None], jnp.float32)


def crossing(rng: np.random.Generator, line: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A node of a line that is not near its ends, and a direction through it, at random."""
    where, angle = line[rng.integers(3, SCENE.nodes - 3)], rng.uniform(0, 2 * np.pi)
    return where, np.array([np.cos(angle), np.sin(angle)])


def cost(simulate: SimulateRod, given: RodPhysics, state: RodState, tool: jax.Array, began: RodState) -> jax.Array:
    """Squared distances [cm^2] from where the ropes were when they `began`, shifted: one number a candidate."""
    goal = jax.lax.stop_gradient(began.nodes[:, :2]) + jnp.array([0.03, 0.02])[:, None]
    return 1e4 * ((simulate(given, state, tool).nodes[:, :2] - goal) ** 2).mean((1, 2))


def central(costs: Callable[..., jax.Array], change: Change, step: float) -> np.ndarray:
    """Slope of each candidate's cost with the amount of a change."""
    ahead, behind = (np.asarray(costs(*change(sign * step)), np.float64) for sign in (1, -1))
    return (ahead - behind) / (2 * step)


def assert_agree(slope: np.ndarray, differences: list[np.ndarray]) -> None:
    """Check slopes against differences in nearly all pushes; a few end as the finger just leaves the rope: a kink."""
    size = max(np.abs(each).max() for each in differences)
    off = np.min([np.abs(slope - each) - 0.1 * np.abs(each) for each in differences], axis=0)
    assert np.isfinite(slope).all()
    assert size > 0
    assert (off <= 2e-3 * size).mean() >= 0.85, (slope, differences)
