"""The finger's tip is found where it is, in the middle of a push, whatever the kinematics say."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.messages import Frame
from app.perception.tool_tip_fit import TIP_POINTS, tool_points
from tests.perception.pushed import TASK, photographed, pushing

RADIUS_M = TASK.finger.radius_m
SEEING = TASK.perception
ELSEWHERE = np.array([0.15, 0.0, 0.0])


@pytest.mark.parametrize("seed", range(6))
def test_the_mean_of_the_points_is_the_tip_within_a_millimetre(seed: int) -> None:
    snapshot, rng = pushing(seed), np.random.default_rng(seed)
    told = snapshot.tip + rng.normal(0, [0.008, 0.008, 0.002])
    points = tool_points(photographed(snapshot, seed), told, SEEING, radius_m=RADIUS_M)
    assert points.shape == (TIP_POINTS, 3)
    off = points.mean(axis=0) - snapshot.tip
    assert np.linalg.norm(off[:2]) < 0.0007
    assert abs(off[2]) < 0.0012


def test_one_camera_is_enough_where_it_sees_the_end() -> None:
    snapshot = pushing(7)
    points = tool_points(photographed(snapshot, 7, cameras=1), snapshot.tip, SEEING, radius_m=RADIUS_M)
    assert np.linalg.norm(points.mean(axis=0) - snapshot.tip) < 0.0015


def test_cameras_that_are_out_of_place_see_the_tip_out_of_place() -> None:
    snapshot, shift = pushing(2), np.array([0.004, -0.003, 0.002])
    frames = photographed(snapshot, 2)
    right, wrong = (
        tool_points(seen, snapshot.tip, SEEING, radius_m=RADIUS_M).mean(axis=0)
        for seen in (frames, [shifted(frame, shift) for frame in frames])
    )
    assert wrong - right == pytest.approx(shift, abs=3e-4)


def test_where_the_finger_is_elsewhere_there_are_no_points() -> None:
    snapshot = pushing(0)
    frames = photographed(snapshot, 0)
    assert len(tool_points(frames, snapshot.tip + ELSEWHERE, SEEING, radius_m=RADIUS_M)) == 0
    assert len(tool_points([], snapshot.tip, SEEING, radius_m=RADIUS_M)) == 0


def test_a_finger_whose_end_is_hidden_gives_no_points() -> None:
    snapshot = pushing(0)
    covered = [without_low_part(frame, snapshot.tip) for frame in photographed(snapshot, 0)]
    assert len(tool_points(covered, snapshot.tip, SEEING, radius_m=RADIUS_M)) == 0


def shifted(frame: Frame, by_m: np.ndarray) -> Frame:
    pose = frame.camera.T_world_camera.copy()
    pose[:3, 3] += by_m
    return replace(frame, camera=replace(frame.camera, T_world_camera=pose))


def without_low_part(frame: Frame, tool: np.ndarray) -> Frame:
    """No reading in the rows from 20 mm over the tip downwards."""
    camera = frame.camera
    place = np.linalg.inv(camera.T_world_camera) @ [*tool[:2], tool[2] + 0.02, 1.0]
    row = int((camera.K @ place[:3])[1] / place[2])
    depth = frame.depth.copy()
    depth[row:] = 0
    return replace(frame, depth=depth)
