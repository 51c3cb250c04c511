"""A closed gripper is found where it is, with a cloth hanging from it, however it is turned."""

import numpy as np
import pytest

from app.perception.find_tool import find_tool
from app.rig.simulated.cameras.simulated_cameras import SimulatedCameras
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.world import Snapshot
from app.tasks.cloth_hang import CLOTH, TASK

HELD_M = 0.004


def holding(yaw: float, opening_m: float = HELD_M) -> Snapshot:
    """A cloth that hangs straight down from the gripper."""
    tool = np.array([0.55, -0.15, 0.28, 0.0, np.cos(yaw / 2), np.sin(yaw / 2), 0.0, opening_m])
    along = np.linspace(-0.5, 0.5, CLOTH.nodes_a_side) * CLOTH.size_m
    u, down = (each.ravel() for each in np.meshgrid(0.4 * along, along - along[0] - 0.01, indexing="ij"))
    across = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    nodes = tool[:3] + u[:, None] * across - down[:, None] * np.array([0.0, 0.0, 1.0])
    return Snapshot(time_s=0.0, nodes=nodes, tool=tool, joints=solve_joints(tool))


def seen(snapshot: Snapshot, off_m: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Points of the gripper, which the kinematics have so far beside where it is."""
    told = snapshot.tool.copy()
    told[:3] += off_m
    frames = SimulatedCameras(TASK.stage, (), 3).look(snapshot, stamp_s=0.0, number=0)
    return find_tool(frames, told, TASK.stage.tool, TASK.perception)


@pytest.mark.parametrize("yaw", [-0.6, 0.0, 0.5])
def test_the_mean_of_the_points_is_between_the_tips_whatever_the_kinematics_say(yaw: float) -> None:
    snapshot = holding(yaw)
    for off_m in ((0.0, 0.0, 0.0), (0.006, -0.005, 0.003)):
        points = seen(snapshot, off_m)
        assert len(points) > 0
        assert points.mean(axis=0) - snapshot.tip == pytest.approx(np.zeros(3), abs=3e-3)


def test_an_open_gripper_and_one_whose_opening_is_unknown_are_not_looked_for() -> None:
    assert len(seen(holding(0.0, opening_m=0.04))) == 0
    snapshot = holding(0.0)
    frames = SimulatedCameras(TASK.stage, (), 3).look(snapshot, stamp_s=0.0, number=0)
    assert len(find_tool(frames, snapshot.tool[:7], TASK.stage.tool, TASK.perception)) == 0
