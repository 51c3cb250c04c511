"""The bare table is found level, spread out, and away from all that stands or lies on it."""

from dataclasses import replace

import numpy as np
import pytest

from app.perception.tool_and_table_points import table_points
from tests.perception.pushed import TASK, photographed, pushing

SEEING = TASK.perception


def plane(points: np.ndarray) -> np.ndarray:
    """Slopes along x and y, and height [m] in the middle of the workspace."""
    rows = np.column_stack([points[:, 0] - 0.55, points[:, 1], np.ones(len(points))])
    return np.linalg.lstsq(rows, points[:, 2], rcond=None)[0]


@pytest.mark.parametrize("seed", range(3))
def test_the_plane_through_the_points_is_the_table(seed: int) -> None:
    points = table_points(photographed(pushing(seed), seed), SEEING)
    assert len(points) == 400
    assert np.ptp(points[:, 0]) > 0.5
    assert np.ptp(points[:, 1]) > 0.5
    slope_x, slope_y, height = plane(points)
    assert abs(height) < 0.0003
    assert max(abs(slope_x), abs(slope_y)) < 0.0015


def test_no_point_is_near_the_rope_or_the_finger() -> None:
    snapshot = pushing(1)
    points = table_points(photographed(snapshot, 1), SEEING)[:, :2]
    things = np.vstack([snapshot.nodes[:, :2], snapshot.tip[None, :2]])
    assert np.linalg.norm(points[:, None] - things, axis=-1).min() > 0.025


def test_a_camera_that_is_turned_sees_a_slope() -> None:
    frames, tilt = photographed(pushing(1), 1), np.radians(0.5)
    turn = np.eye(4)
    turn[1:3, 1:3] = [[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]]
    turned = [
        replace(frame, camera=replace(frame.camera, T_world_camera=turn @ frame.camera.T_world_camera))
        for frame in frames
    ]
    assert plane(table_points(turned, SEEING))[1] == pytest.approx(np.tan(tilt), abs=0.001)


def test_where_no_table_is_seen_there_are_no_points() -> None:
    assert len(table_points([], SEEING)) == 0
    blind = [replace(frame, depth=np.zeros_like(frame.depth)) for frame in photographed(pushing(1), 1)]
    assert len(table_points(blind, SEEING)) == 0
