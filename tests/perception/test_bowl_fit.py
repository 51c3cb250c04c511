"""A held bowl in rendered images: its centre, however it is turned, from its outer wall and its rim."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.core.motion import pointing_down
from app.core.types import ToolPose
from app.perception.bowl_fit import BOWL_POINTS
from app.perception.find_tool import find_tool
from app.rig.simulated.cameras.simulated_cameras import SimulatedCameras
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.world import Snapshot
from app.tasks import load

TASK = load("pour_water")
START = TASK.start(0)[::8]


def posed(tilt_rad: float, aside_rad: float) -> ToolPose:
    """A bowl beside the fixed one that leans towards it."""
    toward = -np.array([np.cos(aside_rad), np.sin(aside_rad)])
    turn = Rotation.from_rotvec(tilt_rad * np.array([-toward[1], toward[0], 0.0]))
    pose = pointing_down(np.array([*(np.array([0.55, 0.0]) - 0.1 * toward), 0.144]))
    pose[3:7] = (turn * Rotation.from_quat(pose[3:7], scalar_first=True)).as_quat(scalar_first=True)
    return pose


def seen(pose: ToolPose, by: ToolPose, seed: int = 0) -> np.ndarray:
    """Points of a bowl that is at `pose` and, by the kinematics, at `by`."""
    snapshot = Snapshot(time_s=0.0, nodes=START, tool=pose, joints=solve_joints(pose))
    frames = SimulatedCameras(replace(TASK.stage), (), seed).look(snapshot, stamp_s=0.0, number=0)
    return find_tool(frames, by[:7], TASK.stage.tool, TASK.reconstruction("cpu"))


@pytest.mark.parametrize(("tilt_rad", "aside_rad"), [(0.0, 0.3), (0.6, 2.0), (1.1, -2.5)])
def test_a_bowl_is_found_where_it_is_and_not_where_it_should_be(tilt_rad: float, aside_rad: float) -> None:
    true = posed(tilt_rad, aside_rad)
    told, off = true.copy(), np.array([0.004, -0.003, 0.002])
    told[:3] -= off
    points = seen(true, told)
    assert points.shape == (BOWL_POINTS, 3)
    assert points.mean(0) - told[:3] == pytest.approx(off, abs=1.2e-3)


def test_a_bowl_that_is_far_from_where_it_should_be_is_not_found() -> None:
    told = posed(0.6, 2.0)
    told[:3] += [0.0, 0.15, 0.0]
    assert seen(posed(0.6, 2.0), told).shape == (0, 3)
