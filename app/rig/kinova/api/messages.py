"""Messages about motions: poses, twists, waypoints, the gripper, and actions that report their end.

Field numbers: Kinovarobotics/ros_kortex, kortex_driver/protos/Base.proto; fields that this program does not use are
skipped when read. Lengths are metres, angles degrees; Euler angles turn about the fixed x, then y, then z axis.
"""

from dataclasses import dataclass
from typing import Annotated, final

from app.rig.kinova.api.protobuf import Field
from app.rig.kinova.api.session import Connection


@final
@dataclass(frozen=True, kw_only=True)
class Pose:
    """Pose of a tool: position [m] and Euler angles [degrees]."""

    x: Annotated[float, Field(1, "float")] = 0.0
    y: Annotated[float, Field(2, "float")] = 0.0
    z: Annotated[float, Field(3, "float")] = 0.0
    theta_x: Annotated[float, Field(4, "float")] = 0.0
    theta_y: Annotated[float, Field(5, "float")] = 0.0
    theta_z: Annotated[float, Field(6, "float")] = 0.0


@final
@dataclass(frozen=True, kw_only=True)
class Twist:
    """Velocities [m/s, degrees/s]."""

    linear_x: Annotated[float, Field(1, "float")] = 0.0
    linear_y: Annotated[float, Field(2, "float")] = 0.0
    linear_z: Annotated[float, Field(3, "float")] = 0.0
    angular_x: Annotated[float, Field(4, "float")] = 0.0
    angular_y: Annotated[float, Field(5, "float")] = 0.0
    angular_z: Annotated[float, Field(6, "float")] = 0.0


@final
@dataclass(frozen=True, kw_only=True)
class TwistCommand:
    """A twist that holds until another command: the arm does not implement `duration`."""

    reference_frame: Annotated[int, Field(1, "uint32")] = 0
    twist: Annotated[Twist | None, Field(2, "message")] = None
    duration: Annotated[int, Field(3, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class FingerMessage:
    """One finger of a gripper: Kinova's `Finger`."""

    finger_identifier: Annotated[int, Field(1, "uint32")] = 0
    value: Annotated[float, Field(2, "float")] = 0.0


@final
@dataclass(frozen=True, kw_only=True)
class GripperMessage:
    """Positions or speeds of the fingers: Kinova's `Gripper`."""

    finger: Annotated[tuple[FingerMessage, ...], Field(1, "message")] = ()


@final
@dataclass(frozen=True, kw_only=True)
class GripperCommand:
    """Command to the gripper, in a `GripperMode`."""

    mode: Annotated[int, Field(1, "uint32")] = 0
    gripper: Annotated[GripperMessage | None, Field(2, "message")] = None
    duration: Annotated[int, Field(3, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class GripperRequest:
    """Request for the measured movement in a `GripperMode`."""

    mode: Annotated[int, Field(1, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class CartesianWaypoint:
    """Waypoint: a pose, the highest speeds on the way to it, and the blending radius [m]."""

    pose: Annotated[Pose | None, Field(1, "message")] = None
    reference_frame: Annotated[int, Field(2, "uint32")] = 0
    maximum_linear_velocity: Annotated[float, Field(3, "float")] = 0.0
    maximum_angular_velocity: Annotated[float, Field(4, "float")] = 0.0
    blending_radius: Annotated[float, Field(5, "float")] = 0.0


@final
@dataclass(frozen=True, kw_only=True)
class AngularWaypoint:
    """Joint angles of a waypoint."""

    angles: Annotated[tuple[float, ...], Field(1, "float")] = ()
    maximum_velocities: Annotated[tuple[float, ...], Field(2, "float")] = ()
    duration: Annotated[float, Field(3, "float")] = 0.0


@final
@dataclass(frozen=True, kw_only=True)
class Waypoint:
    """A waypoint of either kind."""

    name: Annotated[str, Field(1, "string")] = ""
    angular_waypoint: Annotated[AngularWaypoint | None, Field(2, "message")] = None
    cartesian_waypoint: Annotated[CartesianWaypoint | None, Field(3, "message")] = None


@final
@dataclass(frozen=True, kw_only=True)
class WaypointList:
    """Waypoints of one motion, without a stop where they blend."""

    waypoints: Annotated[tuple[Waypoint, ...], Field(1, "message")] = ()
    duration: Annotated[float, Field(2, "float")] = 0.0
    use_optimal_blending: Annotated[bool, Field(3, "bool")] = False


@final
@dataclass(frozen=True, kw_only=True)
class TrajectoryError:
    """Error in a list of waypoints."""

    error_type: Annotated[int, Field(1, "uint32")] = 0
    error_value: Annotated[float, Field(3, "float")] = 0.0
    min_value: Annotated[float, Field(4, "float")] = 0.0
    max_value: Annotated[float, Field(5, "float")] = 0.0
    index: Annotated[int, Field(6, "uint32")] = 0
    message: Annotated[str, Field(7, "string")] = ""
    waypoint_index: Annotated[int, Field(8, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class TrajectoryErrorReport:
    """Errors of a list; empty for a valid one."""

    trajectory_error_elements: Annotated[tuple[TrajectoryError, ...], Field(1, "message")] = ()


@final
@dataclass(frozen=True, kw_only=True)
class ValidationReport:
    """The answer to a validation."""

    trajectory_error_report: Annotated[TrajectoryErrorReport | None, Field(1, "message")] = None
    optimal_waypoint_list: Annotated[WaypointList | None, Field(2, "message")] = None


@final
@dataclass(frozen=True, kw_only=True)
class TrajectoryInfo:
    """Reason for a slowdown or an abort of a trajectory; `error_messages.py` has `trajectory_info_type` in words."""

    trajectory_info_type: Annotated[int, Field(1, "uint32")] = 0
    waypoint_index: Annotated[int, Field(2, "uint32")] = 0
    joint_index: Annotated[int, Field(3, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class JointAngle:
    """Angle of one joint [degrees]."""

    joint_identifier: Annotated[int, Field(1, "uint32")] = 0
    value: Annotated[float, Field(2, "float")] = 0.0


@final
@dataclass(frozen=True, kw_only=True)
class JointAngles:
    """Angles of all joints."""

    joint_angles: Annotated[tuple[JointAngle, ...], Field(1, "message")] = ()


@final
@dataclass(frozen=True, kw_only=True)
class InverseKinematicsData:
    """Request for inverse kinematics: a pose and an initial guess."""

    cartesian_pose: Annotated[Pose | None, Field(1, "message")] = None
    guess: Annotated[JointAngles | None, Field(2, "message")] = None


@final
@dataclass(frozen=True, kw_only=True)
class ConstrainedJointAngles:
    """Target joint angles."""

    joint_angles: Annotated[JointAngles | None, Field(1, "message")] = None


@final
@dataclass(frozen=True, kw_only=True)
class ActionHandle:
    """Handle of an action; `action_type` as in `calls.py`."""

    identifier: Annotated[int, Field(1, "uint32")] = 0
    action_type: Annotated[int, Field(2, "uint32")] = 0
    permission: Annotated[int, Field(3, "fixed32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class Action:
    """Command whose end the arm reports."""

    handle: Annotated[ActionHandle | None, Field(1, "message")] = None
    name: Annotated[str, Field(2, "string")] = ""
    reach_joint_angles: Annotated[ConstrainedJointAngles | None, Field(10, "message")] = None
    send_gripper_command: Annotated[GripperCommand | None, Field(36, "message")] = None
    execute_waypoint_list: Annotated[WaypointList | None, Field(41, "message")] = None


@final
@dataclass(frozen=True, kw_only=True)
class ActionList:
    """The actions stored on the arm by name."""

    action_list: Annotated[tuple[Action, ...], Field(1, "message")] = ()


@final
@dataclass(frozen=True, kw_only=True)
class RequestedActionType:
    """Requested type of actions; 0 for all."""

    action_type: Annotated[int, Field(1, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class ActionNotification:
    """An `ActionEvent`; `abort_details` is a sub error."""

    action_event: Annotated[int, Field(1, "uint32")] = 0
    handle: Annotated[ActionHandle | None, Field(2, "message")] = None
    abort_details: Annotated[int, Field(5, "uint32")] = 0
    connection: Annotated[Connection | None, Field(6, "message")] = None
    trajectory_info: Annotated[tuple[TrajectoryInfo, ...], Field(7, "message")] = ()
