"""The arm's shadow holds every pixel that shows the arm, and little else."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.geometry.arm_geometry import JointState
from app.core.geometry.camera import CameraModel
from app.core.geometry.scene_description import Stage
from app.core.geometry.shapes.tools import Finger, Paddle
from app.core.motion import TOOL_DOWN
from app.perception.cloud.robot_mask import pieces, shadow
from app.rig.simulated.cameras.cameras import CameraNoise, table_cameras
from app.rig.simulated.cameras.render import render
from app.rig.simulated.limbs import known_arm
from app.rig.simulated.worlds.arm_model import link_frames, solve_joints
from app.rig.simulated.worlds.world import Snapshot
from app.tasks.bean_sweep import BEANS, PADDLE
from app.tasks.rope_push import FINGER, ROPE

CAMERA = table_cameras()[0]
PERFECT = CameraNoise(depth_per_m=0.0, edge_dropout=0.0, grazing_dropout=0.0, colour_levels=0.0)
OUT_OF_SIGHT = np.column_stack([np.full(11, 0.5), np.linspace(-0.2, 0.2, 11), np.full(11, -0.5)])


FLAT = replace(FINGER, half_width_m=0.02, yaw_rad=0.9)


def posture(x: float, y: float, z: float) -> JointState:
    tool = np.array([x, y, z, *TOOL_DOWN, 0.0])
    return JointState(joints=solve_joints(tool), tool=tool)


def depth_of(at: JointState, tool: Finger | Paddle, camera: CameraModel = CAMERA) -> np.ndarray:
    """The cell with the arm in this posture and nothing else in sight."""
    stage = Stage(body=ROPE, tool=tool) if isinstance(tool, Finger) else Stage(body=BEANS, tool=tool)
    nodes = np.resize(OUT_OF_SIGHT, (11 if isinstance(tool, Finger) else 2 * BEANS.count, 3))
    snapshot = Snapshot(time_s=0.0, nodes=nodes, tool=at.tool, joints=at.joints)
    return render(snapshot, camera, np.random.default_rng(0), stage=stage, noise=PERFECT)[1]


HIGH, LOW = posture(0.45, 0.05, 0.15), posture(0.60, -0.10, 0.006)


def shown(at: JointState, tool: Finger | Paddle) -> np.ndarray:
    """The pixels that show the arm: there the depth is another than with the arm elsewhere, out of sight."""
    away = posture(0.30, 0.0, 0.9)
    return depth_of(at, tool) != np.maximum(depth_of(away, tool), depth_of(at, tool))


@pytest.mark.parametrize("tool", [FINGER, FLAT, PADDLE], ids=["finger", "flat finger", "paddle"])
@pytest.mark.parametrize("at", [HIGH, LOW], ids=["high", "low"])
def test_every_pixel_that_shows_the_arm_is_in_its_shadow(at: JointState, tool: Finger | Paddle):
    dark = np.isfinite(shadow(CAMERA, depth_of(at, tool), pieces(known_arm(tool), at)))
    arm = shown(at, tool)
    assert arm.sum() > 3000
    assert dark[arm].mean() > 0.999


def test_what_lies_behind_the_arm_beside_its_outline_is_not_in_its_shadow():
    dark = np.isfinite(shadow(CAMERA, depth_of(LOW, FINGER), pieces(known_arm(FINGER), LOW)))
    arm = shown(LOW, FINGER)
    assert (dark & ~arm).sum() < 0.15 * arm.sum()


def test_without_depth_the_shadow_is_the_whole_outline_with_its_margin():
    arm = shown(LOW, FINGER)
    blind = np.isfinite(shadow(CAMERA, np.zeros((480, 640), np.uint16), pieces(known_arm(FINGER), LOW)))
    assert blind[arm].all()
    assert blind.sum() < 2.0 * arm.sum()


def test_what_is_measured_in_front_of_the_arm_is_not_in_its_shadow():
    depth = depth_of(LOW, FINGER)
    row, column = np.argwhere(shown(LOW, FINGER)).mean(axis=0).astype(int)
    depth[row - 3 : row + 4, column - 3 : column + 4] = 200
    dark = np.isfinite(shadow(CAMERA, depth, pieces(known_arm(FINGER), LOW)))
    assert not dark[row - 3 : row + 4, column - 3 : column + 4].any()


def test_the_shadow_says_where_the_arm_begins_or_a_little_nearer():
    depth = depth_of(LOW, FINGER)
    begins = shadow(CAMERA, depth, pieces(known_arm(FINGER), LOW))
    ahead_m = (depth * CAMERA.depth_unit_m - begins)[np.isfinite(begins)]
    assert ahead_m.min() > -0.001
    assert np.median(ahead_m) < 0.10


def test_an_arm_behind_the_camera_or_beside_its_view_has_no_shadow():
    turned = CAMERA.T_world_camera.copy()
    turned[:3, 2] *= -1
    turned[:3, 0] *= -1
    away = replace(CAMERA, T_world_camera=turned)
    assert np.isinf(shadow(away, np.zeros((480, 640), np.uint16), pieces(known_arm(FINGER), HIGH))).all()


def test_an_arm_that_touches_the_camera_hides_everything():
    pose = CAMERA.T_world_camera.copy()
    pose[:3, 3] = LOW.tool[:3] + np.array([0.0, 0.05, 0.05])
    touched = replace(CAMERA, T_world_camera=pose)
    assert (shadow(touched, np.zeros((480, 640), np.uint16), pieces(known_arm(FINGER), LOW)) == 0.0).all()


def test_the_known_arm_moves_as_the_simulated_one_does():
    for at in (HIGH, LOW):
        np.testing.assert_allclose(known_arm(FINGER).links(at.joints)[1:], link_frames(at.joints)[:7], atol=1e-12)
