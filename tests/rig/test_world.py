"""The laws of the simulated table: what a limp rope on it does, whatever its parameters."""

import dataclasses

import numpy as np
import pytest

from app.config import Workspace
from app.rig.simulated.physics import WorldPhysics
from app.rig.simulated.rope_world import RopeWorld
from app.tasks.curves import random_curve
from tests.rig.scene import FINGER, PUSH_Z, ROPE, straight_rope

TICK_S = 0.01


def world(centreline: np.ndarray | None = None, *, physics: WorldPhysics | None = None) -> RopeWorld:
    return RopeWorld(ROPE, FINGER, straight_rope() if centreline is None else centreline, physics=physics)


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


def test_the_rope_keeps_its_length_through_a_push() -> None:
    table = world()
    before = length(table.nodes())
    seen = drive(table, (0.46, 0.02), (0.64, 0.05), 0.2)
    assert max(abs(length(rope) - before) for _, rope in seen) < 1e-9


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_rope_that_lies_in_a_curve_does_not_creep(seed: int) -> None:
    rng = np.random.default_rng(seed)
    table = world(random_curve(rng, length_m=ROPE.length_m, height_m=ROPE.radius_m, workspace=Workspace()))
    laid = wait(table, 0.5)
    assert np.abs(wait(table, 2.0) - laid).max() < 1e-4


def test_the_rope_lies_on_the_table_not_in_it() -> None:
    heights = wait(world(), 0.5)[:, 2]
    assert np.all(np.abs(heights - ROPE.radius_m) < 3e-4)


@pytest.mark.parametrize("speed_m_s", [0.1, 0.3])
def test_the_rope_settles_in_less_than_a_second_after_a_push(speed_m_s: float) -> None:
    table = world()
    drive(table, (0.46, 0.0), (0.62, 0.0), speed_m_s)
    settled = wait(table, 1.0)
    assert np.abs(wait(table, 0.5) - settled).max() < 1e-4


def test_the_middle_goes_with_the_finger_and_the_ends_trail() -> None:
    table = world()
    before = table.nodes()
    _, after = drive(table, (0.46, 0.0), (0.62, 0.0), 0.2)[-1]
    moved = after - before
    middle = len(moved) // 2
    assert moved[middle, 0] > 0.10
    assert max(abs(moved[0, 0]), abs(moved[-1, 0])) < moved[middle, 0] / 3
    assert moved[0, 1] > 0.01
    assert moved[-1, 1] < -0.01


def test_the_rope_bends_around_the_finger() -> None:
    """Within 5 cm to either side of the finger a rod would stay within its own bending; a rope falls back."""
    table = world()
    tool, rope = drive(table, (0.46, 0.0), (0.64, 0.0), 0.2)[-1]
    beside = np.abs(np.abs(rope[:, 1] - tool[1]) - 0.05) < 0.01
    assert rope[beside, 0].max() < rope[:, 0].max() - 0.02


@pytest.mark.parametrize("end", [(0.70, 0.0), (0.70, 0.12), (0.60, -0.15)])
def test_the_finger_never_passes_through_the_rope_at_full_speed(end: tuple[float, float]) -> None:
    table = world()
    apart = [
        np.linalg.norm(rope[:, :2] - tool[:2], axis=1).min() for tool, rope in drive(table, (0.46, 0.0), end, 0.30)
    ]
    assert min(apart) > 0.7 * (FINGER.radius_m + ROPE.radius_m)


def test_which_end_of_the_rope_is_the_first_does_not_matter() -> None:
    """The root of the chain of bodies, which cannot roll, stands in its middle."""
    apart = list[float]()
    for seed in range(4):
        rng = np.random.default_rng(seed)
        laid = random_curve(rng, length_m=ROPE.length_m, height_m=ROPE.radius_m, workspace=Workspace())
        way = laid[3 * len(laid) // 4, :2] - laid[len(laid) // 2, :2]
        across = np.array([-way[1], way[0]]) / np.linalg.norm(way)
        start, end = laid[5 * len(laid) // 8, :2] - 0.05 * across, laid[5 * len(laid) // 8, :2] + 0.06 * across
        ends = list[np.ndarray]()
        for line in (laid, laid[::-1]):
            table = world(line)
            drive(table, (start[0], start[1]), (end[0], end[1]), 0.15)
            ends.append(wait(table, 0.5))
        apart.append(float(np.linalg.norm(ends[0] - ends[1][::-1], axis=1).mean()))
    assert np.mean(apart) < 0.5e-3


def test_a_finger_that_does_not_touch_the_rope_does_not_move_it() -> None:
    table = world()
    before = wait(table, 0.5)
    drive(table, (0.60, 0.0), (0.80, 0.1), 0.3)
    assert np.abs(table.nodes() - before).max() < 1e-4


def test_the_rope_bears_a_finger_that_comes_down_on_it() -> None:
    table = world()
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


def test_the_same_push_gives_the_same_rope_to_the_last_bit() -> None:
    first, second = (drive(world(), (0.46, 0.03), (0.60, 0.06), 0.25)[-1][1] for _ in range(2))
    assert np.array_equal(first, second)


def test_more_friction_between_finger_and_rope_drags_it_further_along() -> None:
    """A finger that slides along the rope takes it along the more, the rougher it is."""

    def dragged(friction: float) -> float:
        physics = dataclasses.replace(WorldPhysics(), finger_friction=friction)
        _, rope = drive(world(physics=physics), (0.47, -0.10), (0.54, 0.12), 0.2)[-1]
        return float(rope[:, 1].mean())

    assert dragged(0.8) > dragged(0.05) + 0.005


def test_a_snapshot_has_the_arm_reach_the_tool() -> None:
    from app.rig.simulated.arm_model import link_frames

    table = world()
    drive(table, (0.46, 0.0), (0.48, 0.02), 0.2)
    snapshot = table.snapshot()
    assert np.allclose(link_frames(snapshot.joints)[-1][:3, 3], table.tool[:3], atol=1e-9)
    assert np.array_equal(snapshot.nodes, table.nodes())
