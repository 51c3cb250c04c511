"""Images and the world: where pixels lie, and which of them lie nowhere."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from app.perception.cloud.depth import behind_an_edge, deproject, nearest, project
from tests.perception.scene import camera_at, turned_quarter, two_cameras, views


def everywhere(depth: np.ndarray) -> np.ndarray:
    return np.ones(depth.shape, bool)


@given(seed=st.integers(0, 2**32 - 1))
def test_a_pixel_of_the_world_point_it_shows_is_itself(seed):
    rng = np.random.default_rng(seed)
    T_world_camera = np.eye(4)
    T_world_camera[:3, :3] = Rotation.random(random_state=rng.integers(2**31)).as_matrix()
    T_world_camera[:3, 3] = rng.uniform(-1, 1, 3)
    camera = replace(two_cameras()[0], T_world_camera=T_world_camera)
    depth = rng.integers(300, 1500, (6, 8)).astype(np.uint16)
    column, row, z = project(deproject(depth, everywhere(depth), camera), camera).T
    np.testing.assert_allclose(row, np.indices(depth.shape)[0].ravel(), atol=2e-3)
    np.testing.assert_allclose(column, np.indices(depth.shape)[1].ravel(), atol=2e-3)
    np.testing.assert_allclose(z, depth.ravel() * camera.depth_unit_m, atol=1e-6)


def test_a_camera_that_looks_straight_down_sees_the_table_at_zero():
    T_world_camera = np.diag([1.0, -1.0, -1.0, 1.0])
    T_world_camera[:3, 3] = 0.5, 0.1, 0.7
    camera = replace(two_cameras()[0], T_world_camera=T_world_camera)
    depth = np.full((camera.height, camera.width), 700, np.uint16)
    points = deproject(depth, everywhere(depth), camera)
    np.testing.assert_allclose(points[:, 2], 0, atol=1e-6)
    width_m = (camera.width - 1) * 0.7 / camera.K[0, 0]
    assert np.ptp(points[:, 0]) == pytest.approx(width_m, rel=1e-5)
    # The image's first row is the farthest from the robot's right: image down is world -y here.
    assert points[0, 1] > points[-1, 1]


def test_points_of_a_whole_image_come_in_the_order_of_its_pixels():
    """Whoever thins them out keeps the same ones each time."""
    camera = two_cameras()[0]
    depth = np.random.default_rng(0).integers(600, 900, (camera.height, camera.width)).astype(np.uint16)
    column, row, _ = project(deproject(depth, everywhere(depth), camera), camera).T
    rows, columns = np.indices(depth.shape).reshape(2, -1)
    np.testing.assert_array_equal(np.rint(row), rows)
    np.testing.assert_array_equal(np.rint(column), columns)


def test_only_masked_pixels_with_a_reading_become_points():
    depth = np.array([[500, 0], [600, 700]], np.uint16)
    mask = np.array([[True, True], [False, True]])
    points = deproject(depth, mask, two_cameras()[0])
    assert points.shape == (2, 3)
    _, _, z = project(points, two_cameras()[0]).T
    np.testing.assert_allclose(z, [0.5, 0.7], atol=1e-6)


def test_a_camera_turned_about_its_axis_gives_the_same_points(tube):
    frame = views(tube)[0]
    turned = turned_quarter(frame)
    here, there = (deproject(each.depth, everywhere(each.depth), each.camera) for each in (frame, turned))
    np.testing.assert_allclose(np.sort(here, axis=0), np.sort(there, axis=0), atol=1e-6)


def test_a_point_behind_the_camera_has_no_pixel():
    camera = camera_at((0.55, 0.5, 0.5), name="left")
    column, row, z = project(np.float32([[0.55, 1.0, 1.0]]), camera)[0]
    assert z < 0
    assert np.isnan([column, row]).all()


def test_pixels_behind_an_edge_are_marked_and_those_of_the_front_are_not():
    depth = np.full((9, 12), 700, np.uint16)
    depth[:, :4] = 650
    depth[:, 4] = 680
    marked = behind_an_edge(depth, 0.010, two_cameras()[0])
    assert marked[:, 4:6].all()
    assert not marked[:, :4].any()
    assert not marked[:, 6:].any()


@given(slope=st.integers(0, 4), share=st.floats(0, 0.5), seed=st.integers(0, 2**32 - 1))
def test_a_slope_has_no_edges_whatever_readings_are_missing(slope, share, seed):
    depth = np.broadcast_to(600 + slope * np.arange(20), (15, 20)).astype(np.uint16)
    depth = np.where(np.random.default_rng(seed).random(depth.shape) < share, 0, depth).astype(np.uint16)
    assert not behind_an_edge(depth, 0.005, two_cameras()[0]).any()


def test_the_nearest_reading_passes_over_missing_ones():
    depth = np.zeros((5, 9), np.uint16)
    depth[2, 1], depth[2, 2] = 700, 800
    near = nearest(depth)
    assert (near[1:4, :3] == 700).all()
    assert (near[1:4, 3] == 800).all()
    assert (near[:, 4:] == 0).all()
