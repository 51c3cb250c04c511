"""The plane of a table is found through what else is seen, and places above it are where they were."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.perception.cloud.table_plane import plane_of_clouds, plane_of_points


def table(tilt_deg: float, height_m: float, *, count: int = 400, noise_m: float = 1e-3) -> np.ndarray:
    rng = np.random.default_rng(0)
    level = np.column_stack([rng.uniform(-0.4, 0.4, (count, 2)), rng.normal(0, noise_m, count)])
    turn = Rotation.from_euler("xy", [tilt_deg, tilt_deg / 2], degrees=True)
    return (turn.apply(level) + np.array([3.0, -1.0, height_m])).astype(np.float32)


@pytest.mark.parametrize(("tilt_deg", "height_m"), [(0.0, 0.0), (1.0, 0.4), (-3.0, -0.2), (40.0, 0.9)])
def test_a_plane_is_found_beside_a_hand(tilt_deg: float, height_m: float) -> None:
    points = table(tilt_deg, height_m)
    points[::5] += np.array([0.0, 0.0, 0.15], np.float32)
    plane = plane_of_points(points)
    assert plane is not None
    normal = Rotation.from_euler("xy", [tilt_deg, tilt_deg / 2], degrees=True).apply([0.0, 0.0, 1.0])
    assert np.degrees(np.arccos(np.clip(plane.normal @ normal, -1, 1))) < 0.1
    above = plane.above(points.astype(np.float64))
    assert np.median(above[np.arange(len(points)) % 5 != 0, 2]) == pytest.approx(0.0, abs=5e-4)


def test_levelling_keeps_distances_and_hardly_moves_places() -> None:
    points = table(1.0, 0.4).astype(np.float64)
    plane = plane_of_points(points.astype(np.float32))
    assert plane is not None
    above = plane.above(points)
    assert np.linalg.norm(np.diff(above, axis=0), axis=1) == pytest.approx(
        np.linalg.norm(np.diff(points, axis=0), axis=1)
    )
    assert np.abs(above - points)[:, :2].max() < 3e-4


def test_a_bowed_table_is_not_flat_and_a_noisy_one_is() -> None:
    points = table(0.0, 0.0)
    bowed = points + np.column_stack([np.zeros((len(points), 2)), 0.1 * (points[:, 0] - 3.0) ** 2]).astype(np.float32)
    for cloud, flat in ((points, True), (table(0.0, 0.0, noise_m=4e-3), True), (bowed, False)):
        plane = plane_of_points(cloud)
        assert plane is not None
        assert plane.flat is flat


def test_the_lowest_points_of_clouds_say_the_height_alone_where_they_are_narrow() -> None:
    rng = np.random.default_rng(0)
    rope = np.column_stack([rng.uniform(0, 0.4, 300), rng.normal(0, 0.004, 300), rng.uniform(0.7, 0.716, 300)])
    plane = plane_of_clouds([rope.astype(np.float32)])
    assert plane is not None
    assert plane.tilt_deg == 0
    assert plane.height_m == pytest.approx(0.7, abs=3e-3)
    assert plane_of_clouds([]) is None
    assert plane_of_points(np.zeros((3, 3), np.float32)) is None
