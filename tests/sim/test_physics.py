"""Laws of mechanics that the simulator keeps."""

from dataclasses import replace
from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest

from app.sim.model.scene import Body, Scene
from app.sim.runtime.rollout import make_rollout
from app.sim.state import State
from app.sim.tools.finger import FingerCollider
from tests.sim.scenes import PARTICLES, SCENE, block, far_tool, floating, phi_with, rope

HIGH = replace(SCENE, high=(0.60, 0.10, 0.30))


def run(scene: Scene, state: State, tool: np.ndarray, **values: float) -> State:
    """The first candidate of a rollout with the nominal parameters but for `values`."""
    simulate = make_rollout(scene, particle_count=state.x.shape[1])
    end = simulate(jnp.asarray(phi_with(**values))[None], state, jnp.asarray(tool)[None])
    return State(*(np.asarray(part[0], np.float64) for part in end))


def angular_momentum(x: np.ndarray, v: np.ndarray, C: np.ndarray, cell_m: float) -> np.ndarray:
    """Per particle mass, of the particles and of their affine fields (Jiang et al. 2015, section 5.3)."""
    curl = np.stack([C[:, 2, 1] - C[:, 1, 2], C[:, 0, 2] - C[:, 2, 0], C[:, 1, 0] - C[:, 0, 1]], axis=1)
    return (np.cross(x, v) + cell_m**2 / 4 * curl).sum(0)


def test_a_body_in_free_fall_follows_newton_and_keeps_its_shape():
    scene, steps = replace(HIGH, damping_1_s=0.0), 200
    start = State.at_rest(jnp.asarray(rope(height_m=0.20))[None])
    end = run(scene, start, far_tool(steps))
    time = steps * scene.dt_s
    assert end.v == pytest.approx(np.tile([0, 0, -9.81 * time], (PARTICLES, 1)), abs=2e-4)
    drop = np.asarray(start.x[0])[:, 2] - end.x[:, 2]
    assert drop == pytest.approx(9.81 * time * (time + scene.dt_s) / 2, rel=1e-3)
    assert pytest.approx(np.tile(np.eye(3), (PARTICLES, 1, 1)), abs=2e-3) == end.F


def test_momentum_and_angular_momentum_of_a_body_that_touches_nothing_stay():
    rng = np.random.default_rng(0)
    start = State.at_rest(jnp.asarray(rope(height_m=0.04))[None])
    start = start._replace(
        v=jnp.asarray(rng.normal(0, 0.1, start.v.shape), jnp.float32),
        C=jnp.asarray(rng.normal(0, 5, start.C.shape), jnp.float32),
        F=start.F + jnp.asarray(rng.normal(0, 0.1, start.F.shape), jnp.float32),
    )
    end = run(floating(), start, far_tool(100))
    first = State(*(np.asarray(part[0], np.float64) for part in start))
    centre = first.x.mean(0)
    assert np.abs(end.v - first.v).max() > 0.1  # Something happened: the deformation was released.
    assert end.v.sum(0) == pytest.approx(first.v.sum(0), abs=2e-4 * np.abs(first.v).sum())
    spin = angular_momentum(first.x - centre, first.v, first.C, SCENE.cell_m)
    later = angular_momentum(end.x - centre, end.v, end.C, SCENE.cell_m)
    assert later == pytest.approx(spin, abs=2e-3 * np.linalg.norm(spin))


@pytest.mark.parametrize("friction", [0.3, 0.6])
def test_a_sliding_block_stops_after_v_squared_over_2_mu_g(friction: float):
    scene = replace(SCENE, damping_1_s=0.0, bodies=(Body(volume_m3=0.03**3, density_kg_m3=800.0),))
    start = State.at_rest(jnp.asarray(block(6, spacing_m=0.005, low=(0.46, -0.015, 0.0)))[None])
    settled = run(scene, start, far_tool(200), stiffness=1e5, table_friction=friction)
    speed = 0.4
    moving = State(*(jnp.asarray(part, jnp.float32)[None] for part in settled))
    moving = moving._replace(v=moving.v + jnp.float32([speed, 0, 0]))
    end = run(scene, moving, far_tool(800), stiffness=1e5, table_friction=friction)
    assert np.abs(end.v.mean(0)).max() < 2e-3
    slid = (end.x - settled.x).mean(0)
    assert slid[0] == pytest.approx(speed**2 / (2 * friction * 9.81), rel=0.05)
    assert abs(slid[1]) < 1e-3


def test_a_rope_at_rest_stays_where_it_lies():
    start = State.at_rest(jnp.asarray(rope())[None])
    end = run(SCENE, start, far_tool(600))
    assert np.abs(end.x - np.asarray(start.x[0])).max() < 5e-4
    assert np.abs(end.v).max() < 2e-3


ROPE = rope(300, length_m=0.4)
FINGER = FingerCollider(radius_m=0.009)
ROPE_SCENE = Scene(tools=(FINGER,), bodies=(Body(volume_m3=8.0e-5, density_kg_m3=800.0),))
stiffnesses = pytest.mark.parametrize("stiffness", [1e4, 3e4, 1e5])


@cache
def pushed(stiffness: float, distance_m: float = 0.15) -> tuple[np.ndarray, np.ndarray]:
    """Particles (300, 3) of a rope of 0.4 m, ordered along it, after a push in its middle at 0.3 m/s; and the tip."""
    scene = ROPE_SCENE
    steps = round(distance_m / 0.3 / scene.dt_s)
    tool = np.float32([0.51, -0.022, 0.006]) + scene.dt_s * np.arange(steps + 1)[:, None] * np.float32([0, 0.3, 0])
    end = run(scene, State.at_rest(jnp.asarray(ROPE)[None]), tool.astype(np.float32), stiffness=stiffness)
    return end.x, tool[-1]


@stiffnesses
def test_no_particle_of_a_pushed_rope_is_inside_the_finger_or_behind_it(stiffness: float):
    x, tip = pushed(stiffness)
    away = x[:, :2] - tip[:2]
    assert np.linalg.norm(away, axis=1).min() > FINGER.radius_m
    before_it = np.abs(away[:, 0]) < 0.01
    assert before_it.any()
    assert away[before_it, 1].min() > 0


@stiffnesses
def test_a_pushed_rope_bends_around_the_finger_and_its_ends_trail(stiffness: float):
    x, tip = pushed(stiffness)
    middle, ends = x[145:155], np.concatenate([x[:10], x[-10:]])
    assert middle[:, 1].mean() > tip[1]
    assert ends[:, 1].max() < middle[:, 1].mean() - 0.05


@stiffnesses
def test_a_pushed_rope_neither_tears_nor_leaves_the_table(stiffness: float):
    x, _ = pushed(stiffness)
    before, after = (np.linalg.norm(np.diff(at.reshape(30, 10, 3).mean(1), axis=0), axis=1) for at in (ROPE, x))
    assert after.sum() < 1.2 * before.sum()
    assert after.max() < 2 * ROPE_SCENE.cell_m
    assert x[:, 2].min() > -1e-3
    assert x[:, 2].max() < 0.022


def test_a_stiffer_rope_bends_in_a_wider_arc():
    widths = []
    for stiffness in (3e3, 2e4, 1e5):
        x, _ = pushed(stiffness, distance_m=0.10)
        widths.append((x[:, 1] > x[:, 1].max() / 2).sum())
    assert widths[0] < widths[1] < widths[2]
