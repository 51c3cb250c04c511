"""Feedback of the arm, as `BaseCyclic.RefreshFeedback` answers: metres, degrees, newtons, volts, Celsius.

Field numbers: Kinovarobotics/ros_kortex, kortex_driver/protos (`BaseCyclic.proto`, `InterconnectCyclicMessage.proto`,
`GripperCyclicMessage.proto`). Fault banks are bit fields; `error_messages.py` has the meaning of each bit.
"""

from dataclasses import dataclass
from typing import Annotated, final

from app.rig.kinova.api.protobuf import Field


@final
@dataclass(frozen=True, kw_only=True)
class ActuatorFeedback:
    """One joint."""

    command_id: Annotated[int, Field(1, "fixed32")] = 0
    status_flags: Annotated[int, Field(2, "fixed32")] = 0
    position: Annotated[float, Field(4, "float")] = 0.0
    velocity: Annotated[float, Field(5, "float")] = 0.0
    torque: Annotated[float, Field(6, "float")] = 0.0
    current_motor: Annotated[float, Field(7, "float")] = 0.0
    voltage: Annotated[float, Field(8, "float")] = 0.0
    temperature_motor: Annotated[float, Field(9, "float")] = 0.0
    temperature_core: Annotated[float, Field(10, "float")] = 0.0
    fault_bank_a: Annotated[int, Field(11, "fixed32")] = 0
    fault_bank_b: Annotated[int, Field(12, "fixed32")] = 0
    warning_bank_a: Annotated[int, Field(13, "fixed32")] = 0
    warning_bank_b: Annotated[int, Field(14, "fixed32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class BaseFeedback:
    """The arm as a whole; `active_state` is an `ArmStateCode`."""

    active_state_connection_identifier: Annotated[int, Field(1, "uint32")] = 0
    active_state: Annotated[int, Field(2, "uint32")] = 0
    arm_voltage: Annotated[float, Field(3, "float")] = 0.0
    arm_current: Annotated[float, Field(4, "float")] = 0.0
    temperature_cpu: Annotated[float, Field(5, "float")] = 0.0
    temperature_ambient: Annotated[float, Field(6, "float")] = 0.0
    tool_pose_x: Annotated[float, Field(13, "float")] = 0.0
    tool_pose_y: Annotated[float, Field(14, "float")] = 0.0
    tool_pose_z: Annotated[float, Field(15, "float")] = 0.0
    tool_pose_theta_x: Annotated[float, Field(16, "float")] = 0.0
    tool_pose_theta_y: Annotated[float, Field(17, "float")] = 0.0
    tool_pose_theta_z: Annotated[float, Field(18, "float")] = 0.0
    tool_twist_linear_x: Annotated[float, Field(19, "float")] = 0.0
    tool_twist_linear_y: Annotated[float, Field(20, "float")] = 0.0
    tool_twist_linear_z: Annotated[float, Field(21, "float")] = 0.0
    tool_twist_angular_x: Annotated[float, Field(22, "float")] = 0.0
    tool_twist_angular_y: Annotated[float, Field(23, "float")] = 0.0
    tool_twist_angular_z: Annotated[float, Field(24, "float")] = 0.0
    tool_external_wrench_force_x: Annotated[float, Field(25, "float")] = 0.0
    tool_external_wrench_force_y: Annotated[float, Field(26, "float")] = 0.0
    tool_external_wrench_force_z: Annotated[float, Field(27, "float")] = 0.0
    tool_external_wrench_torque_x: Annotated[float, Field(28, "float")] = 0.0
    tool_external_wrench_torque_y: Annotated[float, Field(29, "float")] = 0.0
    tool_external_wrench_torque_z: Annotated[float, Field(30, "float")] = 0.0
    fault_bank_a: Annotated[int, Field(31, "fixed32")] = 0
    fault_bank_b: Annotated[int, Field(32, "fixed32")] = 0
    warning_bank_a: Annotated[int, Field(33, "fixed32")] = 0
    warning_bank_b: Annotated[int, Field(34, "fixed32")] = 0
    commanded_tool_pose_x: Annotated[float, Field(35, "float")] = 0.0
    commanded_tool_pose_y: Annotated[float, Field(36, "float")] = 0.0
    commanded_tool_pose_z: Annotated[float, Field(37, "float")] = 0.0
    commanded_tool_pose_theta_x: Annotated[float, Field(38, "float")] = 0.0
    commanded_tool_pose_theta_y: Annotated[float, Field(39, "float")] = 0.0
    commanded_tool_pose_theta_z: Annotated[float, Field(40, "float")] = 0.0


@final
@dataclass(frozen=True, kw_only=True)
class MotorFeedback:
    """The motor of a gripper: `position` 0 open to 100 closed, its current in milliamperes."""

    motor_id: Annotated[int, Field(1, "fixed32")] = 0
    position: Annotated[float, Field(4, "float")] = 0.0
    velocity: Annotated[float, Field(5, "float")] = 0.0
    current_motor: Annotated[float, Field(7, "float")] = 0.0
    voltage: Annotated[float, Field(8, "float")] = 0.0
    temperature_motor: Annotated[float, Field(10, "float")] = 0.0


@final
@dataclass(frozen=True, kw_only=True)
class GripperFeedback:
    """The gripper."""

    status_flags: Annotated[int, Field(2, "fixed32")] = 0
    fault_bank_a: Annotated[int, Field(3, "fixed32")] = 0
    fault_bank_b: Annotated[int, Field(4, "fixed32")] = 0
    motor: Annotated[tuple[MotorFeedback, ...], Field(7, "message")] = ()


@final
@dataclass(frozen=True, kw_only=True)
class InterconnectFeedback:
    """The wrist, to which a gripper is attached."""

    status_flags: Annotated[int, Field(2, "fixed32")] = 0
    fault_bank_a: Annotated[int, Field(12, "fixed32")] = 0
    fault_bank_b: Annotated[int, Field(13, "fixed32")] = 0
    gripper_feedback: Annotated[GripperFeedback | None, Field(18, "message")] = None


@final
@dataclass(frozen=True, kw_only=True)
class Feedback:
    """Complete feedback of one moment."""

    frame_id: Annotated[int, Field(1, "fixed32")] = 0
    base: Annotated[BaseFeedback | None, Field(2, "message")] = None
    actuators: Annotated[tuple[ActuatorFeedback, ...], Field(3, "message")] = ()
    interconnect: Annotated[InterconnectFeedback | None, Field(4, "message")] = None
