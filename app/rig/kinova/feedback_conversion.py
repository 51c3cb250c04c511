"""Conversion of feedback to this program's units: SI, quaternions, and the world's frame, the table's."""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.geometry.table_place import AT_BASE, TablePlace
from app.core.types import ToolPose
from app.rig.kinova.api.codes import ArmStateCode
from app.rig.kinova.api.error_messages import faults
from app.rig.kinova.api.feedback import BaseFeedback, Feedback, GripperFeedback, InterconnectFeedback, MotorFeedback
from app.rig.kinova.gen3 import Joints

_STILL_M_S, _STILL_DEG_S = 0.005, 1.0
_READY = (
    ArmStateCode.IDLE,
    ArmStateCode.SERVOING_READY,
    ArmStateCode.SERVOING_PLAYING_SEQUENCE,
    ArmStateCode.SERVOING_MANUALLY_CONTROLLED,
)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ArmFeedback:
    """State of the arm, received at `time_s`. `closed`: the fingers, 0 to 1; `faults`: sentences, or none.

    `velocity` [m/s] and `force` [N] of the tool; `gripper_ma`: the current of the gripper's motor [mA]; `ready`: it
    accepts commands; `by`: the arm's number of the connection whose command it obeyed last.
    """

    time_s: float
    tool: ToolPose
    velocity: Float64[np.ndarray, "3"]
    joints: Joints
    force: Float64[np.ndarray, "3"]
    closed: float
    gripper_ma: float
    still: bool
    ready: bool
    by: int
    faults: tuple[str, ...]


def feedback_of(said: Feedback, time_s: float, opening_m: float, table: TablePlace = AT_BASE) -> ArmFeedback | None:
    """State from feedback, for fingers that open by `opening_m`; None where a number is not finite.

    In the frame of a table at `table`.
    """
    base, actuators = said.base or BaseFeedback(), said.actuators
    gripper = (said.interconnect or InterconnectFeedback()).gripper_feedback or GripperFeedback()
    motor = gripper.motor[0] if gripper.motor else MotorFeedback(position=100.0)
    closed = min(max(motor.position / 100.0, 0.0), 1.0)
    tool, velocity, force = _tool(base, (1.0 - closed) * opening_m), _velocity(base), _force(base)
    joints = np.radians([(each.position + 180.0) % 360.0 - 180.0 for each in actuators])
    if len(joints) != 7 or not np.isfinite([*tool, *velocity, *force, *joints, motor.current_motor]).all():
        return None
    fastest = max(abs(each.velocity) for each in actuators)
    return ArmFeedback(
        time_s=time_s,
        tool=table.poses_in_table(tool),
        velocity=table.vector_in_table(velocity),
        joints=joints,
        force=table.vector_in_table(force),
        closed=closed,
        gripper_ma=motor.current_motor,
        still=float(np.linalg.norm(velocity)) < _STILL_M_S and fastest < _STILL_DEG_S,
        ready=base.active_state in _READY,
        by=base.active_state_connection_identifier,
        faults=_faults(said),
    )


def _tool(base: BaseFeedback, opening_m: float) -> ToolPose:
    angles = [base.tool_pose_theta_x, base.tool_pose_theta_y, base.tool_pose_theta_z]
    turn = Rotation.from_euler("xyz", angles, degrees=True).as_quat(scalar_first=True)
    # One fixed sign of the two, or a tool that points down would seem to jump.
    turn = turn * (np.sign(turn[np.argmax(np.abs(turn))]) or 1.0)
    return np.array([base.tool_pose_x, base.tool_pose_y, base.tool_pose_z, *turn, opening_m])


def _velocity(base: BaseFeedback) -> Float64[np.ndarray, "3"]:
    return np.array([base.tool_twist_linear_x, base.tool_twist_linear_y, base.tool_twist_linear_z])


def _force(base: BaseFeedback) -> Float64[np.ndarray, "3"]:
    return np.array(
        [base.tool_external_wrench_force_x, base.tool_external_wrench_force_y, base.tool_external_wrench_force_z]
    )


def _faults(said: Feedback) -> tuple[str, ...]:
    base, wrist = said.base or BaseFeedback(), said.interconnect or InterconnectFeedback()
    return faults(base.fault_bank_a, tuple(each.fault_bank_a for each in said.actuators), wrist.fault_bank_a)
