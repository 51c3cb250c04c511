"""Occluded motion: points that a tool pushes while nobody looks go ahead of it, and nothing else moves."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.core.geometry.finger_distance import from_core
from app.core.geometry.shapes.tools import Gripper, Tool
from app.core.motion import TOOL_DOWN
from app.perception.body.occluded_motion import carry_along
from app.tasks.bean_sweep import PADDLE
from app.tasks.rope_push import FINGER
from bench.unseen_pushes import pushed_rope

WIDTH_M = 0.02
HOLDING = Gripper(half_m=(0.01, 0.005, 0.02), opening_m=0.08, closed_m=0.01)


def way(begin: tuple[float, float], end: tuple[float, float], z: float, turn_rad: float = 0.0) -> np.ndarray:
    turned = Rotation.from_euler("z", turn_rad) * Rotation.from_quat(TOOL_DOWN, scalar_first=True)
    quaternion = turned.as_quat(scalar_first=True)
    return np.array([[x, y, z, *quaternion, 0.0] for x, y in (begin, end)])


def grid(z: float = 0.01) -> np.ndarray:
    """Points a centimetre apart about (0.5, 0)."""
    x, y = np.meshgrid(np.arange(0.42, 0.58, 0.01), np.arange(-0.08, 0.08, 0.01))
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], axis=1).astype(np.float32)


@pytest.mark.parametrize("yaw", [0.0, 0.6, 1.57, 2.5])
def test_a_flat_finger_leaves_nothing_where_it_is_and_a_finger_a_radius_beside_it_does_no_more(yaw: float):
    """Points that are aside of the finger by more than `WIDTH_M` stay."""
    tool = replace(FINGER, radius_m=0.006, half_width_m=0.02, yaw_rad=yaw)
    points = grid()
    moved = carry_along(points, tool, way((0.5, -0.10), (0.5, 0.02), 0.006), WIDTH_M)
    outside = np.linalg.norm(from_core(np.array([0.5, 0.02]) - moved[:, :2].astype(float), tool.half_m), axis=1)
    assert outside.min() > tool.radius_m - 0.001
    by = moved - points
    assert (by[:, 1] > -1e-7).all()
    assert by[:, 1].max() > 0.03
    aside = np.abs(points[:, 0] - 0.5) > tool.radius_m + abs(tool.half_m[0]) + WIDTH_M
    np.testing.assert_array_equal(moved[aside], points[aside])


@pytest.mark.parametrize("tool", [FINGER, PADDLE], ids=["finger", "paddle"])
def test_nothing_is_left_where_the_tool_is_and_all_goes_its_way(tool: Tool):
    points = grid()
    moved = carry_along(points, tool, way((0.5, -0.10), (0.5, 0.02), 0.006 if tool is FINGER else 0.0215), WIDTH_M)
    by = moved - points
    assert by[:, 1].max() > 0.03
    np.testing.assert_allclose(by[:, [0, 2]], 0.0, atol=1e-7)
    assert (by[:, 1] > -1e-7).all()
    away = moved[:, :2] - [0.5, 0.02]
    reach = FINGER.radius_m if tool is FINGER else PADDLE.half_m[1]
    under = np.abs(away[:, 0]) < (0.002 if tool is FINGER else PADDLE.half_m[0] - 1e-6)
    assert not (under & (np.abs(away[:, 1]) < reach - 0.001)).any()


def test_what_is_farther_aside_than_its_width_stays():
    points = grid()
    moved = carry_along(points, FINGER, way((0.5, -0.10), (0.5, 0.02), 0.006), WIDTH_M)
    aside = np.abs(points[:, 0] - 0.5) > FINGER.radius_m + WIDTH_M
    np.testing.assert_array_equal(moved[aside], points[aside])


@pytest.mark.parametrize(
    ("tool", "path"),
    [
        (FINGER, way((0.5, 0.0), (0.5, 0.0), 0.006)),
        (FINGER, way((0.5, -0.1), (0.5, 0.1), 0.12)),
        (HOLDING, way((0.5, -0.1), (0.5, 0.1), 0.0)),
        (FINGER, np.zeros((0, 8))),
    ],
    ids=["at rest", "lifted", "holding", "unknown"],
)
def test_a_tool_that_does_not_push_moves_nothing(tool: Tool, path: np.ndarray):
    np.testing.assert_array_equal(carry_along(grid(), tool, path, WIDTH_M), grid())


@pytest.mark.parametrize("tool", [FINGER, PADDLE], ids=["finger", "paddle"])
def test_the_same_push_in_another_direction_does_the_same(tool: Tool):
    z, angle = (0.006 if tool is FINGER else 0.0215), 0.7
    turn = Rotation.from_euler("z", angle).as_matrix()
    ends = np.array([[0.5, -0.10, 0.0], [0.5, 0.02, 0.0]]) @ turn.T
    straight = carry_along(grid(), tool, way((0.5, -0.10), (0.5, 0.02), z), WIDTH_M)
    turned = carry_along(
        (grid() @ turn.T).astype(np.float32),
        tool,
        way((ends[0, 0], ends[0, 1]), (ends[1, 0], ends[1, 1]), z, angle),
        WIDTH_M,
    )
    off = np.linalg.norm(turned - straight @ turn.T, axis=1)
    # A point on the very outline may be taken for inside or outside.
    assert np.median(off) < 1e-6
    assert (off < 0.004).mean() > 0.95


def test_a_rope_that_is_pushed_unseen_is_nearer_to_where_it_is_than_if_it_had_stayed():
    errors = pushed_rope(0)
    assert errors["carried"] < 0.7 * errors["kept"]
    assert errors["kept"] < errors["mask"]
