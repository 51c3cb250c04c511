"""The laws of the simulated table: what a limp rope on it does, whatever its parameters."""

import dataclasses
from typing import get_args

import numpy as np
import pytest

from app.config import Workspace
from app.core.errors import SimulationError
from app.core.geometry.scene_description import RopeModel, Stage
from app.policy.random_pushes import PushDesign
from app.rig.simulated.kinds import kind_of
from app.rig.simulated.worlds.engine import advance, mujoco, new_spec
from app.rig.simulated.worlds.physics import ROPE_WORLDS, WorldPhysics
from app.rig.simulated.worlds.rope_world import RopeWorld
from app.tasks import load
from app.tasks.elements.curves import random_curve
from bench.rehearsal import rehearse
from tests.rig.hidden.moments import injected
from tests.rig.hidden.moments import world as hiding_world
from tests.rig.scene import FINGER, PUSH_Z, ROPE, straight_rope

TICK_S = 0.01
LENGTH_M = {"chain": 1e-9, "cable": 2e-3}
"""Largest change of the rope's length [m]: hinges keep it, and elastic segments give half a percent."""


@pytest.fixture(params=get_args(RopeModel))
def physics(request: pytest.FixtureRequest) -> WorldPhysics:
    """Physics of each world of ropes."""
    return ROPE_WORLDS[request.param]


def world(physics: WorldPhysics, centreline: np.ndarray | None = None) -> RopeWorld:
    return RopeWorld(ROPE, FINGER, straight_rope() if centreline is None else centreline, physics=physics)


def curve(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return random_curve(rng, length_m=ROPE.length_m, height_m=ROPE.radius_m, workspace=Workspace())


def across(rope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Start and end of a push straight across the rope beside its middle."""
    way = rope[3 * len(rope) // 4, :2] - rope[len(rope) // 2, :2]
    aside = np.array([-way[1], way[0]]) / np.linalg.norm(way)
    touched = rope[5 * len(rope) // 8, :2]
    return touched - 0.05 * aside, touched + 0.06 * aside


def drive(
    table: RopeWorld, start: tuple[float, float], end: tuple[float, float], speed_m_s: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Push from `start` to `end`; the tool and the rope at every tick."""
    begin, finish = np.array([*start, PUSH_Z]), np.array([*end, PUSH_Z])
    table.place(begin)
    ticks = max(1, round(float(np.linalg.norm(finish - begin)) / speed_m_s / TICK_S))
    seen: list[tuple[np.ndarray, np.ndarray]] = []
    for tick in range(1, ticks + 1):
        table.step(begin + (finish - begin) * tick / ticks, TICK_S)
        seen.append((table.tool, table.nodes()))
    return seen


def length(rope: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(rope, axis=0), axis=1).sum())


def wait(table: RopeWorld, duration_s: float) -> np.ndarray:
    table.step(table.tool, duration_s)
    return table.nodes()


def test_the_rope_keeps_its_length_through_a_push(physics: WorldPhysics) -> None:
    table = world(physics)
    before = length(table.nodes())
    seen = drive(table, (0.46, 0.02), (0.64, 0.05), 0.2)
    bound_m = LENGTH_M["chain" if physics.cable is None else "cable"]
    assert max(abs(length(rope) - before) for _, rope in seen) < bound_m


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_rope_that_lies_in_a_curve_does_not_creep(seed: int, physics: WorldPhysics) -> None:
    table = world(physics, curve(seed))
    laid = wait(table, 0.5)
    assert np.abs(wait(table, 2.0) - laid).max() < 1e-4


def test_the_rope_lies_on_the_table_not_in_it(physics: WorldPhysics) -> None:
    heights = wait(world(physics), 0.5)[:, 2]
    assert np.all(np.abs(heights - ROPE.radius_m) < 3e-4)


@pytest.mark.parametrize("speed_m_s", [0.1, 0.3])
def test_the_rope_settles_in_less_than_a_second_after_a_push(speed_m_s: float, physics: WorldPhysics) -> None:
    table = world(physics)
    drive(table, (0.46, 0.0), (0.62, 0.0), speed_m_s)
    settled = wait(table, 1.0)
    assert np.abs(wait(table, 0.5) - settled).max() < 1e-4


def test_the_middle_goes_with_the_finger_and_the_ends_trail(physics: WorldPhysics) -> None:
    table = world(physics)
    before = table.nodes()
    _, after = drive(table, (0.46, 0.0), (0.62, 0.0), 0.2)[-1]
    moved = after - before
    middle = len(moved) // 2
    assert moved[middle, 0] > 0.10
    assert max(abs(moved[0, 0]), abs(moved[-1, 0])) < moved[middle, 0] / 3
    assert moved[0, 1] > 0.01
    assert moved[-1, 1] < -0.01


def test_the_rope_bends_around_the_finger(physics: WorldPhysics) -> None:
    """Within 5 cm to either side of the finger a rod would stay within its own bending; a rope falls back."""
    table = world(physics)
    tool, rope = drive(table, (0.46, 0.0), (0.64, 0.0), 0.2)[-1]
    beside = np.abs(np.abs(rope[:, 1] - tool[1]) - 0.05) < 0.01
    assert rope[beside, 0].max() < rope[:, 0].max() - 0.02


@pytest.mark.parametrize("end", [(0.70, 0.0), (0.70, 0.12), (0.60, -0.15)])
def test_the_finger_never_passes_through_the_rope_at_full_speed(
    end: tuple[float, float], physics: WorldPhysics
) -> None:
    table = world(physics)
    apart = [
        np.linalg.norm(rope[:, :2] - tool[:2], axis=1).min() for tool, rope in drive(table, (0.46, 0.0), end, 0.30)
    ]
    assert min(apart) > 0.7 * (FINGER.radius_m + ROPE.radius_m)


def test_which_end_of_the_rope_is_the_first_does_not_matter(physics: WorldPhysics) -> None:
    """The root body of the chain, which cannot roll, is in its middle."""
    apart = list[float]()
    for seed in range(4):
        laid = curve(seed)
        start, end = across(laid)
        ends = list[np.ndarray]()
        for line in (laid, laid[::-1]):
            table = world(physics, line)
            drive(table, (start[0], start[1]), (end[0], end[1]), 0.15)
            ends.append(wait(table, 0.5))
        apart.append(float(np.linalg.norm(ends[0] - ends[1][::-1], axis=1).mean()))
    assert np.mean(apart) < 0.5e-3


@pytest.mark.parametrize("seed", range(4))
def test_a_mirrored_push_leaves_a_mirrored_rope(seed: int, physics: WorldPhysics) -> None:
    laid, ends = curve(seed), list[np.ndarray]()
    start, end = across(laid)
    for side in (np.ones(3), np.array([1.0, -1.0, 1.0])):
        table = world(physics, laid * side)
        drive(table, tuple(start * side[:2]), tuple(end * side[:2]), 0.2)
        ends.append(wait(table, 0.5) * side)
    moved = np.linalg.norm(ends[0] - world(physics, laid).nodes(), axis=1).mean()
    assert moved > 5e-3
    assert np.linalg.norm(ends[1] - ends[0], axis=1).mean() < 0.02 * moved


@pytest.mark.parametrize("seed", [0, 1])
def test_less_friction_lets_a_pushed_rope_slide_on(seed: int, physics: WorldPhysics) -> None:
    """The finger leaves the rope with its speed, which friction takes."""

    def coasts_m(friction: float) -> float:
        table = world(dataclasses.replace(physics, table_friction=friction), straight_rope())
        _, left = drive(table, (0.46, 0.02 * seed), (0.60, 0.02 * seed), 0.3)[-1]
        table.place(np.array([0.30, 0.0, 0.30]))
        return float(np.linalg.norm(wait(table, 1.0) - left, axis=1).mean())

    assert coasts_m(0.05) > 2 * coasts_m(0.5)


def test_a_finger_that_does_not_touch_the_rope_does_not_move_it(physics: WorldPhysics) -> None:
    table = world(physics)
    before = wait(table, 0.5)
    drive(table, (0.60, 0.0), (0.80, 0.1), 0.3)
    assert np.abs(table.nodes() - before).max() < 1e-4


def test_the_rope_bears_a_finger_that_comes_down_on_it(physics: WorldPhysics) -> None:
    table = world(physics)
    table.place(np.array([0.502, 0.003, 0.05]))
    last = table.nodes()
    fastest = 0.0
    for height in np.linspace(0.05, PUSH_Z, 22):
        table.step(np.array([0.502, 0.003, height]), TICK_S)
        rope = table.nodes()
        fastest = max(fastest, float(np.linalg.norm(rope - last, axis=1).max()) / TICK_S)
        last = rope
    assert fastest < 0.5
    table.step(np.array([0.502, 0.003, 0.1]), 0.5)
    assert np.all(np.abs(wait(table, 0.5)[:, 2] - ROPE.radius_m) < 1e-3)


def test_the_same_push_gives_the_same_rope_to_the_last_bit(physics: WorldPhysics) -> None:
    first, second = (drive(world(physics), (0.46, 0.03), (0.60, 0.06), 0.25)[-1][1] for _ in range(2))
    assert np.array_equal(first, second)


def test_more_friction_between_finger_and_rope_drags_it_further_along(physics: WorldPhysics) -> None:
    """A finger that slides along the rope drags it the farther, the rougher it is."""

    def dragged(friction: float) -> float:
        _, rope = drive(
            world(dataclasses.replace(physics, finger_friction=friction)), (0.47, -0.10), (0.54, 0.12), 0.2
        )[-1]
        return float(rope[:, 1].mean())

    assert dragged(0.8) > dragged(0.05) + 0.005


def test_a_snapshot_has_the_arm_reach_the_tool(physics: WorldPhysics) -> None:
    from app.rig.simulated.worlds.arm_model import link_frames

    table = world(physics)
    drive(table, (0.46, 0.0), (0.48, 0.02), 0.2)
    snapshot = table.snapshot()
    assert np.allclose(link_frames(snapshot.joints)[-1][:3, 3], table.tool[:3], atol=1e-9)
    assert np.array_equal(snapshot.nodes, table.nodes())


def test_a_cell_has_room_for_the_nodes_of_its_world(physics: WorldPhysics) -> None:
    model: RopeModel = "chain" if physics.cable is None else "cable"
    stage = Stage(body=ROPE, tool=FINGER).in_world(model)
    kind = kind_of(stage)
    table = kind.build(stage, straight_rope(), 0.0)
    assert len(table.nodes()) == kind.node_count(stage) == physics.segments + 1


def test_a_cable_opens_where_nothing_holds_it_and_a_rough_table_holds_it() -> None:
    """The cable is elastic about a straight line."""

    def spans_m(friction: float) -> float:
        table = world(dataclasses.replace(ROPE_WORLDS["cable"], table_friction=friction), curve(0))
        rope = wait(table, 1.0)
        return float(np.linalg.norm(rope[-1] - rope[0]))

    laid_m = float(np.linalg.norm(curve(0)[-1] - curve(0)[0]))
    assert spans_m(1e-3) > 0.9 * ROPE.length_m
    assert abs(spans_m(0.5) - laid_m) < 0.02


def test_strands_of_a_folded_rope_do_not_pass_through_each_other(physics: WorldPhysics) -> None:
    table = world(physics)
    drive(table, (0.46, 0.12), (0.58, -0.04), 0.2)
    table.place(np.array([0.30, 0.0, 0.30]))
    drive(table, (0.62, 0.19), (0.52, -0.02), 0.2)
    rope = wait(table, 0.5)
    apart = np.linalg.norm(rope[:, None, :2] - rope[None, :, :2], axis=2)
    along = length(rope) / (len(rope) - 1) * np.abs(np.subtract.outer(np.arange(len(rope)), np.arange(len(rope))))
    assert apart[along > 0.06].min() > 1.5 * ROPE.radius_m


def test_the_solver_has_nothing_to_warn_of_in_random_pushes(
    physics: WorldPhysics, capfd: pytest.CaptureFixture[str]
) -> None:
    takes = list(rehearse(load("rope_push"), PushDesign(episodes=2, pushes=6), physics, (), 3))
    assert len(takes) == 12
    assert "WARNING" not in capfd.readouterr().err


def test_effects_are_not_hidden_in_a_cable_and_a_rigid_rod_is_none() -> None:
    with pytest.raises(ValueError, match="not in a cable"):
        hiding_world(injected("plastic_yield", 0.03), physics=ROPE_WORLDS["cable"])
    with pytest.raises(ValueError, match="rigid rope is a chain"):
        RopeWorld(dataclasses.replace(ROPE, rigid=True), FINGER, straight_rope(), physics=ROPE_WORLDS["cable"])


def test_a_world_that_becomes_unstable_is_an_error_and_does_not_begin_anew() -> None:
    spec = new_spec(WorldPhysics())
    ball = spec.worldbody.add_body()
    ball.add_freejoint()
    ball.add_geom(size=[0.1, 0.0, 0.0])
    model = spec.compile()
    data = mujoco.MjData(model)
    data.time = 2.0
    advance(model, data)
    data.qvel[0] = 1e20
    with pytest.raises(SimulationError, match=r"after 2\.0 s"):
        advance(model, data)
