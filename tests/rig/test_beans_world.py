"""The laws of the simulated table with loose beans, whatever their parameters."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.core.geometry.scene_description import Stage
from app.core.motion import TOOL_DOWN
from app.core.types import ToolPose
from app.rig.simulated.cameras.appearance import surfaces
from app.rig.simulated.kinds import kind_of
from app.rig.simulated.worlds.arm_model import link_frames
from app.rig.simulated.worlds.beans_world import BeansWorld
from app.rig.simulated.worlds.physics import BEAN_WORLD, RollingPhysics, WorldPhysics
from app.tasks.bean_sweep import BEANS, MAT, PADDLE, TASK

TICK_S = 0.01
Z = PADDLE.sweep_height_m
NARROW = BEANS.radius_m


def pose(x: float, y: float, z: float = Z, *, yaw: float = 0.0, tilt: float = 0.0) -> ToolPose:
    """A tool that points down, turned about the vertical, and tilted about its own x axis."""
    turn = Rotation.from_euler("z", yaw) * Rotation.from_quat(TOOL_DOWN, scalar_first=True)
    return np.array([x, y, z, *(turn * Rotation.from_euler("x", tilt)).as_quat(scalar_first=True), 0.0])


def bed(rows: int = 5, columns: int = 8, middle: tuple[float, float] = (0.5, 0.0)) -> np.ndarray:
    """Nodes of beans along y in rows and columns that do not touch."""
    x = middle[0] + 0.012 * (np.arange(rows) - (rows - 1) / 2)
    y = middle[1] + 0.018 * (np.arange(columns) - (columns - 1) / 2)
    at = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full((rows, columns), BEANS.radius_m)], axis=-1).reshape(-1, 3)
    reach = np.array([0.0, BEANS.length_m / 2 - BEANS.radius_m, 0.0])
    return np.stack([at - reach, at + reach], axis=1).reshape(-1, 3)


def world(nodes: np.ndarray | None = None, *, physics: WorldPhysics | None = None) -> BeansWorld:
    nodes = bed() if nodes is None else nodes
    beans = dataclasses.replace(BEANS, count=len(nodes) // 2, mass_kg=0.001 * len(nodes) / 2)
    return BeansWorld(beans, PADDLE, nodes, physics=physics)


def middles(nodes: np.ndarray) -> np.ndarray:
    return nodes.reshape(-1, 2, 3).mean(axis=1)


def sweep(
    table: BeansWorld, start: tuple[float, float], end: tuple[float, float], speed_m_s: float = 0.15
) -> list[tuple[ToolPose, np.ndarray]]:
    """Sweep with the paddle across the way; the tool and the beans at every tick."""
    way = np.subtract(end, start)
    yaw = float(np.arctan2(way[1], way[0])) - np.pi / 2
    table.place(pose(*start, yaw=yaw))
    ticks = max(1, round(float(np.linalg.norm(way)) / speed_m_s / TICK_S))
    seen: list[tuple[ToolPose, np.ndarray]] = []
    for tick in range(1, ticks + 1):
        table.step(pose(*(np.array(start) + way * tick / ticks), yaw=yaw), TICK_S)
        seen.append((table.tool, table.nodes()))
    return seen


def wait(table: BeansWorld, duration_s: float) -> np.ndarray:
    table.step(table.tool, duration_s)
    return table.nodes()


def from_paddle(tool: ToolPose, points: np.ndarray) -> np.ndarray:
    """Points in the frame of the paddle, which lies within its half sides there."""
    turn = Rotation.from_quat(tool[3:7], scalar_first=True) * Rotation.from_quat(TOOL_DOWN, scalar_first=True).inv()
    return turn.inv().apply(points - tool[:3])


def depth_in_paddle(tool: ToolPose, nodes: np.ndarray) -> float:
    """Largest depth [m] of the beans' end middles in the paddle grown by a bean's radius."""
    beyond = np.abs(from_paddle(tool, nodes)) - PADDLE.half_m
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)
    return float((BEANS.radius_m - outside).max())


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_beans_at_rest_stay_where_they_are(seed: int) -> None:
    table = BeansWorld(BEANS, PADDLE, TASK.start(seed))
    laid = wait(table, 0.5)
    assert np.abs(laid - TASK.start(seed)).max() < 2e-4
    assert np.abs(wait(table, 3.0) - laid).max() < 1e-6


def test_beans_keep_their_length() -> None:
    table = world()
    _, nodes = sweep(table, (0.44, 0.0), (0.60, 0.0))[-1]
    lengths = np.linalg.norm(np.diff(nodes.reshape(-1, 2, 3), axis=1), axis=-1)
    np.testing.assert_allclose(lengths, BEANS.length_m - 2 * BEANS.radius_m, atol=1e-9)


def test_a_sweep_takes_the_beans_in_its_way_along_and_no_others() -> None:
    table = world(np.concatenate([bed(3, 4), bed(3, 4, (0.5, 0.15)), bed(3, 4, (0.35, 0.0))]))
    before = middles(wait(table, 0.3))
    sweep(table, (0.45, 0.0), (0.65, 0.0))
    moved = np.linalg.norm(middles(wait(table, 0.6)) - before, axis=1)
    assert moved[:12].min() > 0.10
    assert moved[12:].max() < 1e-4


def test_swept_beans_end_in_front_of_the_paddle_or_beside_it_and_never_behind() -> None:
    table = world()
    sweep(table, (0.44, 0.0), (0.62, 0.0))
    inside = from_paddle(table.tool, middles(wait(table, 0.6)))
    behind = (np.abs(inside[:, 0]) < PADDLE.half_m[0] - BEANS.length_m) & (inside[:, 1] < 0)
    assert not np.any(behind)


@pytest.mark.parametrize("speed_m_s", [0.05, 0.15, 0.30])
@pytest.mark.parametrize("end", [(0.64, 0.0), (0.60, 0.12)])
def test_no_bean_enters_the_paddle_the_table_or_another_bean(end: tuple[float, float], speed_m_s: float) -> None:
    """Depths up to the paddle's path in the time that contacts take to push apart are allowed."""
    table, soft = world(), speed_m_s * WorldPhysics().contact_time_s
    for tool, nodes in sweep(table, (0.43, 0.0), end, speed_m_s):
        assert depth_in_paddle(tool, nodes) < soft + 0.05 * BEANS.radius_m
        assert nodes[:, 2].min() > 0.85 * BEANS.radius_m
        apart = np.linalg.norm(middles(nodes)[:, None] - middles(nodes), axis=-1)
        assert apart[np.triu_indices(len(apart), 1)].min() > 2 * 0.80 * NARROW


def test_many_sweeps_lose_no_bean() -> None:
    table = world()
    rng = np.random.default_rng(0)
    for _ in range(12):
        angle, side = rng.uniform(0, 2 * np.pi), rng.uniform(-0.03, 0.03)
        ahead = np.array([np.cos(angle), np.sin(angle)])
        middle = middles(table.nodes())[:, :2].mean(axis=0) + side * np.array([-ahead[1], ahead[0]])
        sweep(table, tuple((middle - 0.12 * ahead).tolist()), tuple((middle + 0.02 * ahead).tolist()))
        nodes = wait(table, 0.5)
        assert np.isfinite(nodes).all()
        assert nodes[:, 2].min() > 0.8 * BEANS.radius_m
        assert nodes[:, 2].max() < 0.06


@pytest.mark.parametrize("speed_m_s", [0.10, 0.15])
def test_swept_beans_come_to_rest_within_a_second_and_near_the_paddle(speed_m_s: float) -> None:
    table = world()
    sweep(table, (0.44, 0.0), (0.60, 0.0), speed_m_s)
    stopped = table.nodes()
    rested = wait(table, 1.0)
    assert np.linalg.norm(rested - stopped, axis=1).max() < 0.04
    assert np.abs(wait(table, 0.5) - rested).max() < 1e-3


def test_beans_that_hit_each_other_share_their_momentum() -> None:
    """Without friction on the table, both beans keep all the momentum that the paddle gave them."""
    free = WorldPhysics(table_friction=1e-4, rolling=RollingPhysics(rolling_m=1e-9, spin_m=1e-9))
    table = world(bed(2, 1), physics=free)
    sweep(table, (0.475, 0.0), (0.500, 0.0), 0.2)
    table.place(pose(0.3, 0.0, 0.3))
    places = [middles(wait(table, duration_s))[:, 0] for duration_s in (0.1, 0.2, 0.2)]
    speeds, later = ((after - before) / 0.2 for before, after in pairwise(places))
    assert speeds.min() > 0.1
    assert later.sum() == pytest.approx(speeds.sum(), rel=0.02)


def test_more_rolling_resistance_stops_beans_sooner() -> None:
    def reach(rolling_m: float) -> float:
        table = world(physics=dataclasses.replace(BEAN_WORLD, rolling=RollingPhysics(rolling_m=rolling_m)))
        sweep(table, (0.44, 0.0), (0.60, 0.0), 0.3)
        return float(wait(table, 1.5)[:, 0].max())

    assert reach(1e-3) < reach(1e-4) - 0.01


def test_beans_bear_a_paddle_that_comes_down_on_them() -> None:
    table = world(bed(1, 3))
    table.place(pose(0.5, 0.0, 0.08))
    for height in np.linspace(0.08, Z, 40):
        table.step(pose(0.5, 0.0, float(height)), TICK_S)
    table.step(pose(0.5, 0.0, 0.12), 0.5)
    nodes = wait(table, 1.0)
    assert np.all(np.abs(nodes[:, 2] - BEANS.radius_m) < 1e-3)
    assert np.linalg.norm(middles(nodes)[:, :2] - [0.5, 0.0], axis=1).max() < 0.15


def test_the_paddle_turns_and_tilts_as_it_is_told() -> None:
    table = world()
    table.place(pose(0.3, 0.2, 0.2, yaw=0.3))
    end = pose(0.35, 0.1, 0.25, yaw=-0.9, tilt=0.4)
    table.step(end, 0.5)
    np.testing.assert_allclose(table.tool[:3], end[:3], atol=1e-9)
    assert abs(table.tool[3:7] @ end[3:7]) == pytest.approx(1.0, abs=1e-9)


def test_a_paddle_that_turns_on_the_spot_takes_beans_with_it() -> None:
    table = world(bed(1, 1, (0.53, 0.015)))
    table.place(pose(0.5, 0.0, yaw=0.0))
    before = middles(table.nodes())[0]
    for yaw in np.linspace(0.0, 1.2, 60):
        table.step(pose(0.5, 0.0, yaw=float(yaw)), TICK_S)
    assert np.linalg.norm(middles(table.nodes())[0] - before) > 0.01


def test_the_same_sweep_gives_the_same_beans_to_the_last_bit() -> None:
    first, second = (sweep(world(), (0.44, 0.01), (0.60, 0.03))[-1][1] for _ in range(2))
    assert np.array_equal(first, second)


def test_a_snapshot_has_the_arm_reach_the_paddle_and_shows_beans_paddle_and_mat() -> None:
    table = BeansWorld(BEANS, PADDLE, TASK.start(0))
    table.step(pose(0.5, 0.1, 0.1, yaw=0.7), 0.1)
    snapshot = table.snapshot()
    np.testing.assert_allclose(link_frames(snapshot.joints)[-1][:3, 3], table.tool[:3], atol=1e-9)
    shown = surfaces(snapshot, TASK.stage)
    assert [part.colour for part in shown[: BEANS.count]] == [BEANS.colour] * BEANS.count
    for bean, nodes in zip(shown[: BEANS.count], snapshot.nodes.reshape(-1, 2, 3), strict=True):
        reach = np.abs(bean.vertices - nodes.mean(axis=0)).max()
        assert reach <= BEANS.length_m / 2 + 1e-4
    board = next(part for part in shown if part.vertices.shape == (8, 3))
    assert np.all(np.abs(np.abs(from_paddle(table.tool, board.vertices)) - PADDLE.half_m) < 1e-5)
    mat = next(part for part in shown if part.colour == MAT.colour)
    assert mat.vertices[:, 2].max() < 0.002
    np.testing.assert_allclose(mat.vertices[:, :2].mean(axis=0), MAT.place_m, atol=1e-6)


def test_a_stage_whose_tool_beans_do_not_know_is_refused() -> None:
    from app.tasks.rope_push import FINGER

    with pytest.raises(TypeError, match="Paddle, not with a Finger"):
        kind_of(TASK.stage).build(Stage(body=BEANS, tool=FINGER), TASK.start(0), 0.0)
