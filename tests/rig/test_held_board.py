"""The board in the simulated gripper: where it is said to be, behind what is nearer, good enough to calibrate by."""

from dataclasses import replace
from datetime import date

import numpy as np
from scipy.spatial.transform import Rotation

from app.core.geometry.lens import Lens
from app.core.motion import TOOL_DOWN
from app.perception.calibration.se3 import transform_points
from app.perception.calibration.sight import sight
from app.perception.calibration.solve import CalibrationView, solve
from app.rig.simulated.cameras.cameras import table_cameras
from app.rig.simulated.cameras.held_board import HeldBoard, paint
from app.rig.simulated.cameras.render import render
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.world import Snapshot
from app.tasks.rope_push import TASK

CAMERA = table_cameras()[0]
LENS = Lens(width=CAMERA.width, height=CAMERA.height, K=CAMERA.K)
HELD = HeldBoard()
ROPE = np.column_stack([np.full(41, 0.55), np.linspace(-0.2, 0.2, 41), np.full(41, 0.008)])


def tool(x: float, y: float, z: float, tilt_deg: tuple[float, float, float]) -> np.ndarray:
    down = Rotation.from_quat(TOOL_DOWN, scalar_first=True)
    turn = Rotation.from_rotvec(np.radians(tilt_deg)) * down
    return np.array([x, y, z, *turn.as_quat(scalar_first=True), 0.0])


def photograph(pose: np.ndarray, rng: np.random.Generator):
    level = tool(*pose[:3], (0.0, 0.0, 0.0))
    snapshot = Snapshot(time_s=0.0, nodes=ROPE, tool=level, joints=solve_joints(level))
    return paint(HELD, pose, CAMERA, *render(snapshot, CAMERA, rng, stage=TASK.stage), rng)


def test_the_board_is_seen_where_the_gripper_has_it() -> None:
    pose = tool(0.42, 0.0, 0.22, (-20.0, 0.0, 0.0))
    color, depth = photograph(pose, np.random.default_rng(0))
    found = sight(color, HELD.board, LENS)
    world = transform_points(HELD.at(pose), found.points(HELD.board))
    camera = (world - CAMERA.T_world_camera[:3, 3]) @ CAMERA.T_world_camera[:3, :3]
    np.testing.assert_allclose(found.pixels, LENS.project(camera), atol=0.4)
    column, row = np.rint(found.pixels[5]).astype(int)
    np.testing.assert_allclose(depth[row, column] * CAMERA.depth_unit_m, camera[5, 2], atol=0.002)


def test_what_is_nearer_hides_it_and_its_back_is_white() -> None:
    pose, rng = tool(0.42, 0.0, 0.22, (-20.0, 0.0, 0.0)), np.random.default_rng(0)
    color, depth = np.full((480, 640, 3), 50, np.uint8), np.full((480, 640), 100, np.uint16)
    hidden, _ = paint(HELD, pose, CAMERA, color, depth, rng)
    assert (hidden == 50).all()
    behind, _ = paint(HELD, tool(0.42, 0.0, 0.22, (160.0, 0.0, 0.0)), CAMERA, color, depth * 0, rng)
    shown = behind[(behind != 50).any(axis=2)]
    assert len(shown) > 1000
    assert shown.min() > 150


def test_a_simulated_camera_is_found_where_it_stands() -> None:
    rng, views = np.random.default_rng(3), []
    tilts = [(-20, 0, 0), (-40, 0, 0), (-20, 20, 0), (-20, -20, 10), (-5, 10, -15), (-35, -15, 0), (-30, 15, 20)]
    for number, tilt in enumerate(tilts):
        pose = tool(0.40 + 0.02 * (number % 3), 0.02 * (number % 4), 0.14 + 0.02 * (number % 3), tilt)
        T = np.eye(4)
        T[:3, :3] = Rotation.from_quat(pose[3:7], scalar_first=True).as_matrix()
        T[:3, 3] = pose[:3]
        views.append(CalibrationView(sight=sight(photograph(pose, rng)[0], HELD.board, LENS), T_world_gripper=T))
    found = solve(views, "fixed", LENS, HELD.board, serial="camera0", calibrated_at=date(2026, 11, 23)).found
    assert np.linalg.norm(found.pose[:3, 3] - CAMERA.T_world_camera[:3, 3]) < 2e-3
    np.testing.assert_allclose(found.pose[:3, :3], CAMERA.T_world_camera[:3, :3], atol=3e-3)
    np.testing.assert_allclose(found.board_pose, replace(HELD).at(np.array([0, 0, 0, 1, 0, 0, 0, 0.0])), atol=3e-3)
