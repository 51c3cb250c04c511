"""The calls that this program makes of an arm: numbers of service and function, message types, and timeouts.

Numbers: `@PROXY_ID` and `@RPC_ID` of Kinovarobotics/ros_kortex, kortex_driver/protos (`Base.proto`, `BaseCyclic.proto`,
`ControlConfig.proto`) and of pitt-rnel/kortex, protos/Session.proto.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Generic, TypeVar, final

from app.rig.kinova.api.feedback import Feedback
from app.rig.kinova.api.messages import (
    Action,
    ActionHandle,
    ActionList,
    ActionNotification,
    GripperCommand,
    GripperMessage,
    GripperRequest,
    InverseKinematicsData,
    JointAngles,
    Pose,
    RequestedActionType,
    TwistCommand,
    ValidationReport,
    WaypointList,
)
from app.rig.kinova.api.session import (
    ArmStateInformation,
    ArmStateNotification,
    Empty,
    Handle,
    NotificationOptions,
    ServoingModeInformation,
    SessionInfo,
)
from app.rig.kinova.api.setup import (
    ActuatorInformation,
    ControlModeInformation,
    FirmwareVersions,
    GravityVector,
    KinematicLimits,
    PayloadInformation,
    ProductConfiguration,
    ProtectionZone,
    ProtectionZoneList,
    ProtectionZoneNotification,
    ToolConfiguration,
    TwistAngularSoftLimit,
    TwistLinearSoftLimit,
)

Asked = TypeVar("Asked")
Answered = TypeVar("Answered")
Told = TypeVar("Told")

ANSWER_S, THOUGHT_S, FEEDBACK_S = 1.0, 6.0, 0.15
"""Timeouts of calls [s]: in general; for those that compute a trajectory first, which takes the arm 1.5 to 2 s
(ros_kortex #258); and for feedback, which is asked for again anyway. Kinova's own client waits 10 s."""


class Service(IntEnum):
    """Services of the arm that are called."""

    SESSION = 1
    BASE = 2
    BASE_CYCLIC = 3
    CONTROL_CONFIG = 16


@final
@dataclass(frozen=True)
class Call(Generic[Asked, Answered]):
    """A function of the arm; `name` is Kinova's."""

    service: Service
    function: int
    name: str
    asked: type[Asked]
    answered: type[Answered]
    timeout_s: float = ANSWER_S


@final
@dataclass(frozen=True, kw_only=True)
class Topic(Generic[Told]):
    """Notification that the arm sends to sessions subscribed by `call`, as events occur."""

    call: Call[NotificationOptions, Handle]
    told: type[Told]


_SESSION, _BASE, _CYCLIC, _CONFIG = Service.SESSION, Service.BASE, Service.BASE_CYCLIC, Service.CONTROL_CONFIG

CREATE_SESSION = Call(_SESSION, 1, "CreateSession", SessionInfo, Empty)
CLOSE_SESSION = Call(_SESSION, 2, "CloseSession", Empty, Empty)
KEEP_ALIVE = Call(_SESSION, 3, "KeepAlive", Empty, Empty)
CREATE_PROTECTION_ZONE = Call(_BASE, 20, "CreateProtectionZone", ProtectionZone, Handle)
DELETE_PROTECTION_ZONE = Call(_BASE, 23, "DeleteProtectionZone", Handle, Empty)
READ_ALL_PROTECTION_ZONES = Call(_BASE, 24, "ReadAllProtectionZones", Empty, ProtectionZoneList)
READ_ALL_ACTIONS = Call(_BASE, 44, "ReadAllActions", RequestedActionType, ActionList)
EXECUTE_ACTION_FROM_REFERENCE = Call(_BASE, 47, "ExecuteActionFromReference", ActionHandle, Empty, THOUGHT_S)
EXECUTE_ACTION = Call(_BASE, 48, "ExecuteAction", Action, Empty, THOUGHT_S)
PAUSE_ACTION = Call(_BASE, 49, "PauseAction", Empty, Empty)
STOP_ACTION = Call(_BASE, 50, "StopAction", Empty, Empty)
RESUME_ACTION = Call(_BASE, 51, "ResumeAction", Empty, Empty)
UNSUBSCRIBE = Call(_BASE, 97, "Unsubscribe", Handle, Empty)
STOP = Call(_BASE, 112, "Stop", Empty, Empty)
SEND_TWIST_COMMAND = Call(_BASE, 121, "SendTwistCommand", TwistCommand, Empty)
SEND_GRIPPER_COMMAND = Call(_BASE, 136, "SendGripperCommand", GripperCommand, Empty)
GET_MEASURED_GRIPPER_MOVEMENT = Call(_BASE, 137, "GetMeasuredGripperMovement", GripperRequest, GripperMessage)
APPLY_EMERGENCY_STOP = Call(_BASE, 145, "ApplyEmergencyStop", Empty, Empty)
CLEAR_FAULTS = Call(_BASE, 146, "ClearFaults", Empty, Empty)
SET_SERVOING_MODE = Call(_BASE, 152, "SetServoingMode", ServoingModeInformation, Empty)
GET_SERVOING_MODE = Call(_BASE, 153, "GetServoingMode", Empty, ServoingModeInformation)
GET_ACTUATOR_COUNT = Call(_BASE, 171, "GetActuatorCount", Empty, ActuatorInformation)
GET_ARM_STATE = Call(_BASE, 175, "GetArmState", Empty, ArmStateInformation)
GET_PRODUCT_CONFIGURATION = Call(_BASE, 198, "GetProductConfiguration", Empty, ProductConfiguration)
GET_FIRMWARE_BUNDLE_VERSIONS = Call(_BASE, 224, "GetFirmwareBundleVersions", Empty, FirmwareVersions)
EXECUTE_WAYPOINT_TRAJECTORY = Call(_BASE, 226, "ExecuteWaypointTrajectory", WaypointList, Empty, THOUGHT_S)
COMPUTE_FORWARD_KINEMATICS = Call(_BASE, 233, "ComputeForwardKinematics", JointAngles, Pose)
COMPUTE_INVERSE_KINEMATICS = Call(_BASE, 234, "ComputeInverseKinematics", InverseKinematicsData, JointAngles)
VALIDATE_WAYPOINT_LIST = Call(_BASE, 235, "ValidateWaypointList", WaypointList, ValidationReport, THOUGHT_S)
REFRESH_FEEDBACK = Call(_CYCLIC, 3, "RefreshFeedback", Empty, Feedback, FEEDBACK_S)
GET_GRAVITY_VECTOR = Call(_CONFIG, 2, "GetGravityVector", Empty, GravityVector)
GET_PAYLOAD_INFORMATION = Call(_CONFIG, 4, "GetPayloadInformation", Empty, PayloadInformation)
GET_TOOL_CONFIGURATION = Call(_CONFIG, 6, "GetToolConfiguration", Empty, ToolConfiguration)
SET_TWIST_LINEAR_SOFT_LIMIT = Call(_CONFIG, 15, "SetTwistLinearSoftLimit", TwistLinearSoftLimit, Empty)
SET_TWIST_ANGULAR_SOFT_LIMIT = Call(_CONFIG, 16, "SetTwistAngularSoftLimit", TwistAngularSoftLimit, Empty)
GET_KINEMATIC_HARD_LIMITS = Call(_CONFIG, 18, "GetKinematicHardLimits", Empty, KinematicLimits)
GET_KINEMATIC_SOFT_LIMITS = Call(_CONFIG, 19, "GetKinematicSoftLimits", ControlModeInformation, KinematicLimits)
PROTECTION_ZONES = Topic(
    call=Call(_BASE, 103, "OnNotificationProtectionZoneTopic", NotificationOptions, Handle),
    told=ProtectionZoneNotification,
)
ACTIONS = Topic(
    call=Call(_BASE, 106, "OnNotificationActionTopic", NotificationOptions, Handle), told=ActionNotification
)
ARM_STATES = Topic(
    call=Call(_BASE, 176, "OnNotificationArmStateTopic", NotificationOptions, Handle), told=ArmStateNotification
)
