"""The paddle's middle is found where it is, in the middle of a sweep, whatever the kinematics say."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.core.messages import Frame
from app.perception.find_tool import find_tool
from app.perception.paddle_fit import PADDLE_POINTS, paddle_points
from app.policy.random_sweeps import sweep_design
from app.rig.simulated.cameras.simulated_cameras import SimulatedCameras
from app.rig.simulated.push_session import PushSession
from app.rig.simulated.worlds.physics import BEAN_WORLD
from app.rig.simulated.worlds.world import Snapshot
from app.tasks.bean_sweep import PADDLE, TASK


@cache
def sweeping(seed: int) -> Snapshot:
    """The cell in the middle of a sweep."""
    session = PushSession(TASK, sweep_design(1, 1), BEAN_WORLD, (), seed)
    session.look()
    return session.push(session.random()).during.snapshot


def photographed(snapshot: Snapshot, seed: int, *, cameras: int = 2) -> list[Frame]:
    return SimulatedCameras(TASK.stage, (), seed, count=cameras).look(snapshot, stamp_s=0.0, number=0)


def found(frames: list[Frame], snapshot: Snapshot, off_m: np.ndarray | None = None) -> np.ndarray:
    told = snapshot.tool[:7].copy()
    told[:3] += np.zeros(3) if off_m is None else off_m
    return paddle_points(frames, told, TASK.perception, half_m=PADDLE.half_m)


@pytest.mark.parametrize("seed", range(6))
def test_the_mean_of_the_points_is_the_middle_within_a_millimetre_and_a_half(seed: int) -> None:
    snapshot, rng = sweeping(seed), np.random.default_rng(seed)
    points = found(photographed(snapshot, seed), snapshot, rng.normal(0, [0.006, 0.006, 0.002]))
    assert points.shape == (PADDLE_POINTS, 3)
    off = points.mean(axis=0) - snapshot.tip
    assert np.linalg.norm(off[:2]) < 0.0015
    assert abs(off[2]) < 0.0005


def test_cameras_that_are_out_of_place_see_the_paddle_out_of_place() -> None:
    snapshot, shift = sweeping(2), np.array([0.004, -0.003, 0.002])
    frames = photographed(snapshot, 2)
    right, wrong = (found(seen, snapshot).mean(axis=0) for seen in (frames, [moved(each, shift) for each in frames]))
    assert wrong - right == pytest.approx(shift, abs=5e-4)


def test_where_the_paddle_is_elsewhere_or_unseen_there_are_no_points() -> None:
    snapshot = sweeping(0)
    frames = photographed(snapshot, 0)
    assert len(found(frames, snapshot, np.array([0.25, 0.0, 0.0]))) == 0
    assert len(found([], snapshot)) == 0


def test_a_paddle_is_found_as_the_tool_that_it_is() -> None:
    snapshot = sweeping(1)
    frames = photographed(snapshot, 1)
    same = find_tool(frames, snapshot.tool[:7], TASK.stage.tool, TASK.perception)
    assert np.array_equal(same, found(frames, snapshot))


def moved(frame: Frame, by_m: np.ndarray) -> Frame:
    pose = frame.camera.T_world_camera.copy()
    pose[:3, 3] += by_m
    return replace(frame, camera=replace(frame.camera, T_world_camera=pose))
