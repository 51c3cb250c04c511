"""Views become one surface: without what only one view believes, and without lonely points."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from app.perception.cloud.fuse import Box, merge, not_seen_through, without_outliers
from tests.perception.scene import two_cameras

CAMERA = two_cameras()[0]
WALL_M = 0.80


def before_the_camera(column: float, row: float, z: float) -> np.ndarray:
    """The world point that the camera has at this pixel and depth, shape (1, 3)."""
    optical = z * np.linalg.solve(CAMERA.K, [column, row, 1.0])
    return (CAMERA.T_world_camera @ [*optical, 1.0])[None, :3].astype(np.float32)


def sheet(rng: np.random.Generator, count: int = 2000) -> np.ndarray:
    points = rng.uniform(0, 0.1, (count, 3))
    points[:, 2] = 0.01 + 0.1 * points[:, 0]
    return points.astype(np.float32)


@given(seed=st.integers(0, 2**32 - 1))
def test_the_order_of_the_views_does_not_matter(seed):
    a, b, c = np.split(sheet(np.random.default_rng(seed), 900), 3)
    np.testing.assert_allclose(merge([a, b, c], 0.005), merge([c, a, b], 0.005), atol=1e-7)


def test_a_view_given_twice_changes_nothing():
    points = sheet(np.random.default_rng(0))
    np.testing.assert_allclose(merge([points, points], 0.005), merge([points], 0.005), atol=1e-7)


@given(voxel_m=st.floats(0.001, 0.02), offset=st.floats(-1, 1))
def test_each_voxel_keeps_one_point_and_each_point_its_voxel(voxel_m, offset):
    points = sheet(np.random.default_rng(1), 300) + np.float32(offset)
    merged = merge([points], voxel_m)
    # In float32 a mean may round onto its voxel's face.
    inside = np.abs(merged / voxel_m - np.rint(merged / voxel_m)).min(axis=1) > 1e-3
    voxels = np.floor(merged[inside] / voxel_m)
    assert len(np.unique(voxels, axis=0)) == len(voxels)
    assert len(merged) == len(np.unique(np.floor(points / voxel_m), axis=0))


def test_averaging_reduces_the_noise():
    rng = np.random.default_rng(2)
    flat = np.concatenate([rng.uniform(0, 0.05, (20_000, 2)), 0.0025 + rng.normal(0, 4e-4, (20_000, 1))], axis=1)
    assert merge([flat.astype(np.float32)], 0.005)[:, 2].std() < 1e-4


def test_a_point_before_what_a_view_sees_is_contradicted_and_all_others_are_not():
    depth = np.full((CAMERA.height, CAMERA.width), round(WALL_M / CAMERA.depth_unit_m), np.uint16)
    depth[100:110, 100:110] = 0
    cases = [
        (before_the_camera(320, 240, WALL_M - 0.05), False),
        (before_the_camera(320, 240, WALL_M - 0.005), True),
        (before_the_camera(320, 240, WALL_M), True),
        (before_the_camera(320, 240, WALL_M + 0.1), True),
        (before_the_camera(105, 105, WALL_M - 0.05), True),
        (before_the_camera(-30, 240, WALL_M - 0.05), True),
        (before_the_camera(320, 500, WALL_M - 0.05), True),
        (before_the_camera(320, 240, -0.2), True),
    ]
    points = np.concatenate([point for point, _ in cases])
    assert not_seen_through(points, depth, CAMERA, 0.01).tolist() == [kept for _, kept in cases]


def test_a_point_on_an_outline_is_not_contradicted_by_the_background_beside_it():
    depth = np.full((CAMERA.height, CAMERA.width), 900, np.uint16)
    depth[:, :200] = 700
    edge = np.concatenate([before_the_camera(column, 240, 0.70) for column in (199.0, 200.4, 203.0)])
    assert not_seen_through(edge, depth, CAMERA, 0.01).tolist() == [True, True, False]


def test_lonely_points_go_and_the_surface_stays():
    surface = sheet(np.random.default_rng(3))
    lonely = np.float32([[0.05, 0.05, 0.08], [0.2, 0.2, 0.02]])
    kept = without_outliers(np.concatenate([surface, lonely]), 8, 3.0)
    assert not (kept[:, None] == lonely).all(-1).any()
    assert len(kept) >= 0.97 * len(surface)


def test_a_cloud_too_small_to_judge_is_left_as_it_is():
    points = sheet(np.random.default_rng(4), 5)
    np.testing.assert_array_equal(without_outliers(points, 8, 3.0), points)


def test_a_box_holds_its_faces_and_names_its_sides():
    box = Box(low=(0.0, 0.0, 0.0), high=(0.5, 0.5, 0.25))
    points = np.float32([[0, 0, 0], [0.5, 0.5, 0.25], [0.25, 0.25, 0.26], [-0.01, 0.25, 0.1]])
    assert box.holds(points).tolist() == [True, True, False, False]
    assert str(box) == "x 0 to 0.5 m, y 0 to 0.5 m, z 0 to 0.25 m"
