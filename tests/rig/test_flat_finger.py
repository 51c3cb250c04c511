"""A flat finger pushes a rope in the simulated worlds, and a rod nearly the same way."""

from dataclasses import replace
from typing import get_args

import jax.numpy as jnp
import numpy as np
import pytest

from app.core.geometry.finger_distance import from_core
from app.core.geometry.scene_description import RopeModel
from app.core.geometry.shapes.tools import Finger
from app.policy.random_pushes import PushDesign
from app.rig.simulated.worlds.physics import ROPE_WORLDS, WorldPhysics
from app.rig.simulated.worlds.rope import resample
from app.rig.simulated.worlds.rope_world import RopeWorld
from app.sim.rods.rollout import RodPhysics, make_rod_rollout
from app.sim.rods.state import RodState
from app.tasks import load
from bench.rehearsal import rehearse
from tests.rig.scene import PUSH_Z, ROPE, straight_rope

TICK_S = 0.01
FLAT = Finger(radius_m=0.006, push_height_m=PUSH_Z, half_width_m=0.02, yaw_rad=np.pi / 2)
ROUND = replace(FLAT, half_width_m=0.0)


@pytest.fixture(params=get_args(RopeModel))
def physics(request: pytest.FixtureRequest) -> WorldPhysics:
    """One for each world of ropes."""
    return ROPE_WORLDS[request.param]


def drive(finger: Finger, physics: WorldPhysics, end_x: float, speed_m_s: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Push a straight rope along y that way along x; the tool's place and the rope at every tick."""
    table = RopeWorld(ROPE, finger, straight_rope(), physics=physics)
    begin, finish = np.array([0.45, 0.0, PUSH_Z]), np.array([end_x, 0.0, PUSH_Z])
    table.place(begin)
    ticks = max(1, round((end_x - 0.45) / speed_m_s / TICK_S))
    seen = list[tuple[np.ndarray, np.ndarray]]()
    for tick in range(1, ticks + 1):
        table.step(begin + (finish - begin) * tick / ticks, TICK_S)
        seen.append((table.tool[:3], table.nodes()))
    return seen


def test_a_rope_stays_straighter_before_a_flat_finger_than_before_a_round_one(physics: WorldPhysics) -> None:
    bows = list[float]()
    for finger in (FLAT, ROUND):
        _, rope = drive(finger, physics, 0.58, 0.15)[-1]
        bows.append(float(np.ptp(rope[np.abs(rope[:, 1]) < 0.02, 0])))
    assert bows[0] < 1e-3
    assert bows[1] > 2 * bows[0]


@pytest.mark.parametrize("degrees", [0, 45, 90])
def test_the_finger_never_passes_through_the_rope_at_full_speed(degrees: int, physics: WorldPhysics) -> None:
    finger = replace(FLAT, yaw_rad=np.radians(degrees))
    apart = [
        np.linalg.norm(from_core(tool[:2] - rope[:, :2], finger.half_m), axis=1).min()
        for tool, rope in drive(finger, physics, 0.70, 0.30)
    ]
    assert min(apart) > 0.7 * (finger.radius_m + ROPE.radius_m)
    assert min(apart) < finger.radius_m + ROPE.radius_m


def test_a_finger_turned_by_half_a_turn_is_the_same(physics: WorldPhysics) -> None:
    ends = [drive(replace(FLAT, yaw_rad=yaw), physics, 0.55, 0.15)[-1][1] for yaw in (0.7, 0.7 + np.pi)]
    assert np.linalg.norm(ends[0] - resample(straight_rope(), len(ends[0])), axis=1).mean() > 0.01
    assert ends[0] == pytest.approx(ends[1], abs=5e-4)


def test_a_rod_moves_as_the_rope_does_that_a_flat_finger_pushes():
    """Within 3 mm on average, where pushes move it by more than 10, with no number fitted to this finger."""
    task = load("rope_push(finger_half_width_m=0.015,finger_radius_m=0.006,finger_yaw_rad=0.6)@rods")
    assert task.rods is not None
    scene = task.rods.scene
    takes = list(rehearse(task, PushDesign(episodes=2, pushes=4), ROPE_WORLDS["chain"], (), 0))
    moved, errors = list[float](), list[float]()
    for take in takes:
        before, after = (resample(look.snapshot.nodes, scene.nodes)[:, :2] for look in (take.before, take.after))
        at = np.arange(take.command.times_s[0], take.command.times_s[-1], scene.dt_s)
        places = take.command.poses[:, :3]
        path = np.stack([np.interp(at, take.command.times_s, places[:, axis]) for axis in range(3)], axis=1)
        given = {"table_friction": 0.5, "finger_friction": 0.25, **task.rods.physics}
        physics = RodPhysics.nominal(scene, 1)._replace(**{name: jnp.full(1, value) for name, value in given.items()})
        end = make_rod_rollout(scene)(physics, RodState.along(jnp.asarray(before.T[None])), jnp.asarray(path[None]))
        errors.append(float(np.linalg.norm(np.asarray(end.nodes[0, :2]).T - after, axis=1).mean()))
        moved.append(float(np.linalg.norm(before - after, axis=1).mean()))
    assert np.mean(moved) > 0.010
    assert np.mean(errors) < 0.003, (moved, errors)
