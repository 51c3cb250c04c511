"""Laws of walls that rods collide with."""

from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.core.errors import ParameterError
from app.sim.rods.rollout import RodPhysics, SimulateRod, make_rod_rollout
from app.sim.rods.scene import RodScene, Wall
from app.sim.rods.state import RodState

GAP_M, X_M, THICK_M = 0.07, 0.60, 0.02
SCENE = RodScene(
    length_m=0.24,
    radius_m=0.008,
    mass_kg=0.0384,
    finger_radius_m=0.009,
    walls=Wall.with_gap(x_m=X_M, gap_m=GAP_M, half_length_m=0.35, thickness_m=THICK_M),
)
MOST_M = 0.004
"""Largest depth [m] to which a wall may be pressed into the rope: half of its radius."""
PARKED_POSE = np.array([0.0, 0.0, 0.3])


@cache
def simulator(*, walls: bool = True) -> SimulateRod:
    return jax.jit(make_rod_rollout(SCENE if walls else replace(SCENE, walls=())))


def lying(x_m: float, y_m: float, heading_rad: float, velocity: tuple[float, float] = (0.0, 0.0)) -> RodState:
    """One straight rope about a place."""
    along = SCENE.rest_m * (np.arange(SCENE.nodes) - SCENE.nodes // 2)
    line = np.stack([x_m + along * np.cos(heading_rad), y_m + along * np.sin(heading_rad)])
    state = RodState.along(jnp.asarray(line[None], jnp.float32))
    return state._replace(nodes=state.nodes.at[:, 2:4].set(jnp.asarray(velocity)[:, None]))


def straight(start: tuple[float, float], velocity: tuple[float, float], seconds: float) -> jax.Array:
    """A finger (1, T, 3) at constant velocity."""
    t = SCENE.dt_s * np.arange(round(seconds / SCENE.dt_s) + 1)
    path = np.stack([start[0] + velocity[0] * t, start[1] + velocity[1] * t, np.full(len(t), 0.006)], axis=1)
    return jnp.asarray(path[None], jnp.float32)


def run(state: RodState, tool: jax.Array, **values: float) -> np.ndarray:
    """Nodes (8, n) after a path of the finger."""
    given = {name: jnp.full(1, value) for name, value in values.items()}
    physics = RodPhysics.nominal(SCENE, 1)._replace(**given)
    return np.asarray(simulator()(physics, state, tool).nodes[0], np.float64)


def still(seconds: float) -> jax.Array:
    return jnp.tile(jnp.asarray(PARKED_POSE), (1, round(seconds / SCENE.dt_s) + 1, 1))


def depth(nodes: np.ndarray) -> float:
    """Depth [m] of the rope in the walls at its deepest node."""
    deepest = -np.inf
    for wall in SCENE.walls:
        nearest = np.clip(nodes[:2].T, wall.low_m, wall.high_m)
        deepest = max(deepest, SCENE.radius_m - np.linalg.norm(nodes[:2].T - nearest, axis=1).min())
    return deepest


@pytest.mark.parametrize("heading", [0.0, 0.6, np.pi / 2])
def test_a_rope_that_is_flung_at_a_wall_stops_or_comes_back_and_is_on_its_side(heading: float):
    half = SCENE.length_m / 2 * abs(np.cos(heading))
    start = lying(X_M - THICK_M / 2 - SCENE.radius_m - half - 0.01, 0.18, heading, (0.6, 0.0))
    for seconds in (0.03, 0.06, 0.2):
        nodes = run(start, still(seconds), table_friction=0.05)
        assert nodes[0].max() < X_M - THICK_M / 2
        assert depth(nodes) < MOST_M


def test_a_rope_that_is_pushed_through_the_gap_folds_gets_through_and_is_never_in_the_walls():
    """The rope lies across, three times as long as the gap is wide; a finger takes its middle along at 0.3 m/s."""
    start = lying(0.52, 0.002, np.pi / 2)
    for seconds in np.linspace(0.1, 1.0, 10):
        nodes = run(start, straight((0.49, 0.0), (0.3, 0.0), float(seconds)))
        assert depth(nodes) < MOST_M
        assert np.abs(nodes[1][np.abs(nodes[0] - X_M) < THICK_M / 2]).max(initial=0.0) < GAP_M / 2
    assert nodes[0].min() > X_M + THICK_M / 2


@pytest.mark.parametrize("speed", [0.1, 0.3])
def test_a_rope_that_is_pushed_against_the_wall_does_not_cross_it(speed: float):
    start = lying(0.56, 0.0, np.pi / 2)
    length = X_M - THICK_M / 2 - 2 * SCENE.radius_m - SCENE.finger_radius_m - 0.52
    nodes = run(start, straight((0.52, 0.10), (speed, 0.0), length / speed))
    upper = nodes[:, nodes[1] > GAP_M / 2]
    assert upper[0].max() < X_M - THICK_M / 2
    assert depth(nodes) < MOST_M


def test_a_rougher_wall_slows_what_slides_along_it():
    start = lying(0.45, X_M, 0.0, (0.3, -0.3))
    scene = replace(SCENE, walls=(Wall(low_m=(0.0, 0.5), high_m=(1.0, 0.59)),))
    ahead = []
    for friction in (0.0, 0.3, 1.0):
        simulate = make_rod_rollout(replace(scene, walls=(replace(scene.walls[0], friction=friction),)))
        physics = RodPhysics.nominal(SCENE, 1)._replace(table_friction=jnp.full(1, 1e-4))
        nodes = np.asarray(simulate(physics, start, still(0.2)).nodes[0])
        ahead.append(float(nodes[2].mean()))
    assert ahead[0] == pytest.approx(0.3, rel=0.02)
    assert ahead[1] == pytest.approx(0.3 - 0.3 * 0.3, rel=0.25)
    assert ahead[2] < ahead[1] - 0.05


def test_gradients_through_contact_with_walls_equal_central_differences():
    rng = np.random.default_rng(2)
    starts = [lying(0.50, rng.uniform(-0.05, 0.05), rng.uniform(-0.6, 0.6), (0.4, 0.0)) for _ in range(16)]
    state = jax.tree.map(lambda *parts: jnp.concatenate(parts), *starts)
    tool, physics = jnp.tile(still(0.25), (16, 1, 1)), RodPhysics.nominal(SCENE, 16)
    physics = physics._replace(table_friction=jnp.full(16, 0.1))
    w = jnp.asarray(rng.normal(0.5, 1.0, (2, SCENE.nodes)), jnp.float32)

    def cost(shift: jax.Array, turn: jax.Array, *, walls: bool = True) -> jax.Array:
        nodes = state.nodes.at[:, :2].add(shift[:, :, None])
        nodes = nodes.at[:, 3].add(turn[:, None] * jnp.linspace(-1, 1, SCENE.nodes))
        end = simulator(walls=walls)(physics, state._replace(nodes=nodes), tool)
        return 1e3 * (w * (end.nodes[:, :2] - jnp.array([0.5, 0.0])[:, None])).mean((1, 2))

    zero, none = jnp.zeros((16, 2)), jnp.zeros(16)
    assert (jnp.abs(cost(zero, none) - cost(zero, none, walls=False)) > 0.5).mean() > 0.5
    slopes = jax.grad(lambda shift, turn: cost(shift, turn).sum(), argnums=(0, 1))(zero, none)
    for axis in (0, 1, 2):
        found = np.asarray(slopes[0][:, axis] if axis < 2 else slopes[1], np.float64)
        off = np.full(16, np.inf)
        for step in (3e-5, 1e-4, 3e-4) if axis < 2 else (1e-3, 3e-3, 1e-2):
            way = (zero.at[:, axis].set(step), none) if axis < 2 else (zero, none + step)
            ahead, behind = cost(*way), cost(*jax.tree.map(jnp.negative, way))
            expected = np.asarray(ahead - behind, np.float64) / (2 * step)
            off = np.minimum(off, np.abs(found - expected) - 0.1 * np.abs(expected) - 0.02 * np.abs(expected).max())
        assert np.isfinite(found).all()
        assert (off <= 0).mean() >= 0.85, (axis, off)


@pytest.mark.parametrize("high", [(0.595, 0.1), (0.605, -0.4)])
def test_a_wall_that_nodes_could_pass_between_them_is_refused(high: tuple[float, float]):
    with pytest.raises(ParameterError, match=r"wall|Wall"):
        replace(SCENE, walls=(Wall(low_m=(0.59, -0.3), high_m=high),))
