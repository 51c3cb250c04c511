"""Emulated firmware: the effect of each call on the arm, and the answer to it. No socket."""

import dataclasses
import time
from collections.abc import Callable
from typing import Any, TypeAlias, final

import numpy as np

from app.rig.kinova import gen3
from app.rig.kinova.api import calls
from app.rig.kinova.api.calls import Call, Service
from app.rig.kinova.api.codes import ControlMode, ServoingMode
from app.rig.kinova.api.errors import WireError
from app.rig.kinova.api.messages import (
    Action,
    ActionHandle,
    ActionList,
    ConstrainedJointAngles,
    FingerMessage,
    GripperMessage,
    InverseKinematicsData,
    JointAngle,
    JointAngles,
    Pose,
    RequestedActionType,
    TrajectoryErrorReport,
    ValidationReport,
    WaypointList,
)
from app.rig.kinova.api.protobuf import decode, encode
from app.rig.kinova.api.session import (
    ArmStateInformation,
    Empty,
    ErrorReply,
    Handle,
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
    Point,
    ProductConfiguration,
    ProtectionZone,
    ProtectionZoneList,
    ToolConfiguration,
    TwistAngularSoftLimit,
    TwistLinearSoftLimit,
)
from app.rig.kinova.client.wire import FrameKind, KortexFrame
from app.rig.kinova.emulator.arm import INVALID, NOT_FOUND, FakeArm, Rejected
from app.rig.kinova.emulator.measured import feedback
from app.rig.kinova.emulator.record import Record
from app.rig.kinova.emulator.sessions import NO_SESSION, ArmSession, Sessions
from app.rig.kinova.emulator.validation import errors, reachable
from app.rig.kinova.emulator.zones import well_formed

_AnyCall: TypeAlias = Call[Any, Any]
_Handler: TypeAlias = Callable[[Any, int], object]

SERVER_ERROR, DEVICE_ERROR = 1, 3
UNKNOWN_SERVICE, UNKNOWN_METHOD, UNREADABLE, NOT_PERMITTED = 4, 5, 13, 54
"""Errors and sub errors of `Errors.proto`."""
MOTIONS = {
    "ExecuteAction",
    "ExecuteActionFromReference",
    "ExecuteWaypointTrajectory",
    "SendTwistCommand",
    "SendGripperCommand",
    "Stop",
    "StopAction",
    "PauseAction",
    "ResumeAction",
    "ApplyEmergencyStop",
    "ClearFaults",
}
"""Names of the calls that are recorded."""
_HOME = Action(
    handle=ActionHandle(identifier=2, action_type=7),
    name="Home",
    reach_joint_angles=ConstrainedJointAngles(
        joint_angles=JointAngles(
            joint_angles=tuple(
                JointAngle(joint_identifier=index, value=float(np.degrees(angle)) % 360.0)
                for index, angle in enumerate(gen3.HOME)
            )
        )
    ),
)
_TOPICS = {each.call.function for each in (calls.ACTIONS, calls.ARM_STATES, calls.PROTECTION_ZONES)}


@final
class Firmware:
    """Answers frames with frames; `arm`, `sessions` and `record` are open to the emulator's owner."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.arm, self.sessions, self.record = FakeArm(), Sessions(), Record()
        self._clock = clock
        self._zones_made = self._subscriptions = 0
        self._handlers = self._table()

    def slow(self, frame: KortexFrame) -> bool:
        """True where the answer takes so long that it must be computed beside the arm's own loop."""
        return frame.service == Service.BASE and frame.function in (235, 234)

    def answer(self, frame: KortexFrame, address: object = None) -> KortexFrame:
        """The answer to a request; an error where it has one."""
        now_s = self._clock()
        if (frame.service, frame.function) == (Service.SESSION, 1):
            return self._create_session(frame, address)
        if (session := self.sessions.get(frame.session)) is None:
            return _error_reply(frame, SERVER_ERROR, NO_SESSION, "no such session")
        self.sessions.hear(session)
        if frame.service == Service.BASE and frame.function in _TOPICS:
            return _reply(frame, self._subscribe(session, frame.function))
        if (handler := self._handlers.get((frame.service, frame.function))) is None:
            known = frame.service in set(Service)
            return _error_reply(frame, SERVER_ERROR, UNKNOWN_METHOD if known else UNKNOWN_SERVICE, "unknown")
        return self._dispatch(frame, session, *handler, now_s)

    def tick(self, duration_s: float) -> None:
        """Advance time: the arm moves, and silent sessions lose their motions."""
        now_s = self._clock()
        for session in self.sessions.silent(duration_s):
            if self.arm.mover == session.number and self.arm.moving:
                self.arm.stop()
        self.arm.tick(now_s, duration_s)

    def notifications(self) -> list[tuple[ArmSession, KortexFrame]]:
        """Events since the last call, for each session subscribed to them."""
        told, self.arm.told = self.arm.told, []
        topics = {each.told: each.call.function for each in (calls.ACTIONS, calls.ARM_STATES, calls.PROTECTION_ZONES)}
        return [
            (session, _notification(session, handle, encode(message)))
            for message in told
            for session in self.sessions
            if (handle := session.topics.get(topics[type(message)])) is not None
        ]

    def _create_session(self, frame: KortexFrame, address: object) -> KortexFrame:
        try:
            info = decode(SessionInfo, frame.payload)
        except WireError as error:
            return _error_reply(frame, SERVER_ERROR, UNREADABLE, str(error))
        if refused := self.sessions.refusal_code(info):
            return _error_reply(frame, SERVER_ERROR, refused, "")
        session = self.sessions.create(info, address)
        return _reply(dataclasses.replace(frame, session=session.number), Empty())

    def _subscribe(self, session: ArmSession, function: int) -> Handle:
        self._subscriptions = self._subscriptions % 0xFFFF + 1
        session.topics[function] = self._subscriptions
        return Handle(identifier=self._subscriptions)

    def _dispatch(
        self,
        frame: KortexFrame,
        session: ArmSession,
        call: _AnyCall,
        handler: _Handler,
        now_s: float,
    ) -> KortexFrame:
        try:
            asked = decode(call.asked, frame.payload)
        except WireError as error:
            return _error_reply(frame, SERVER_ERROR, UNREADABLE, str(error))
        refused = 0
        try:
            if call.name == self.arm.adversity.denies:
                raise Rejected(NOT_PERMITTED)
            return _reply(frame, handler(asked, session.number) or Empty())
        except Rejected as denied:
            refused = denied.sub_code
            return _error_reply(frame, DEVICE_ERROR, refused, "")
        finally:
            if call.name in MOTIONS:
                self.record.note(now_s, call.name, session.number, asked, refused)

    def _table(self) -> dict[tuple[int, int], tuple[_AnyCall, _Handler]]:
        """Table of calls by service and function number."""
        arm = self.arm
        pairs: list[tuple[_AnyCall, _Handler]] = [
            (calls.CLOSE_SESSION, lambda _, session: self.sessions.close(session)),
            (calls.KEEP_ALIVE, lambda _, __: None),
            (calls.UNSUBSCRIBE, lambda handle, session: self._unsubscribe(handle.identifier, session)),
            (calls.CREATE_PROTECTION_ZONE, lambda zone, _: self._create_zone(zone)),
            (calls.DELETE_PROTECTION_ZONE, lambda handle, _: self._delete_zone(handle.identifier)),
            (
                calls.READ_ALL_PROTECTION_ZONES,
                lambda _, __: ProtectionZoneList(protection_zones=(*arm.zones.values(),)),
            ),
            (calls.READ_ALL_ACTIONS, lambda asked, _: _actions(asked)),
            (calls.EXECUTE_ACTION_FROM_REFERENCE, self._execute_known),
            (calls.EXECUTE_ACTION, self._execute),
            (calls.EXECUTE_WAYPOINT_TRAJECTORY, self._execute_waypoints),
            (calls.PAUSE_ACTION, lambda _, __: arm.pause()),
            (calls.RESUME_ACTION, lambda _, __: arm.resume()),
            (calls.STOP_ACTION, lambda _, __: arm.stop()),
            (calls.STOP, lambda _, __: arm.stop()),
            (calls.SEND_TWIST_COMMAND, arm.twist),
            (calls.SEND_GRIPPER_COMMAND, arm.close_fingers),
            (
                calls.GET_MEASURED_GRIPPER_MOVEMENT,
                lambda _, __: GripperMessage(finger=(FingerMessage(value=arm.fingers.position),)),
            ),
            (calls.APPLY_EMERGENCY_STOP, lambda _, __: arm.emergency_stop()),
            (calls.CLEAR_FAULTS, lambda _, __: arm.clear_faults()),
            (calls.SET_SERVOING_MODE, self._set_servoing),
            (calls.GET_SERVOING_MODE, lambda _, __: ServoingModeInformation(servoing_mode=arm.servoing)),
            (calls.GET_ACTUATOR_COUNT, lambda _, __: ActuatorInformation(count=7)),
            (calls.GET_ARM_STATE, lambda _, __: ArmStateInformation(active_state=arm.state)),
            (calls.GET_PRODUCT_CONFIGURATION, lambda _, __: ProductConfiguration(kin="simulated", degree_of_freedom=7)),
            (calls.GET_FIRMWARE_BUNDLE_VERSIONS, lambda _, __: FirmwareVersions(main_bundle_version="2.8.0-simulated")),
            (calls.COMPUTE_FORWARD_KINEMATICS, lambda asked, _: gen3.pose(gen3.tool(_joints(asked)))),
            (calls.COMPUTE_INVERSE_KINEMATICS, lambda asked, _: _inverse(asked)),
            (calls.VALIDATE_WAYPOINT_LIST, lambda asked, _: self._validate(asked)),
            (calls.REFRESH_FEEDBACK, lambda _, __: feedback(arm)),
            (calls.GET_GRAVITY_VECTOR, lambda _, __: GravityVector(z=arm.adversity.gravity_z)),
            (
                calls.GET_PAYLOAD_INFORMATION,
                lambda _, __: PayloadInformation(payload_mass=arm.adversity.payload_kg),
            ),
            (calls.GET_TOOL_CONFIGURATION, lambda _, __: self._tool()),
            (calls.SET_TWIST_LINEAR_SOFT_LIMIT, lambda asked, _: self._limit_linear(asked)),
            (calls.SET_TWIST_ANGULAR_SOFT_LIMIT, lambda asked, _: self._limit_angular(asked)),
            (calls.GET_KINEMATIC_HARD_LIMITS, lambda _, __: _limits(gen3.LINEAR_M_S, gen3.ANGULAR_DEG_S, 0)),
            (calls.GET_KINEMATIC_SOFT_LIMITS, lambda asked, _: self._soft_limits(asked)),
        ]
        return {(call.service, call.function): (call, handler) for call, handler in pairs}

    def _unsubscribe(self, handle: int, number: int) -> None:
        if (session := self.sessions.get(number)) is not None:
            session.topics = {topic: known for topic, known in session.topics.items() if known != handle}

    def _execute(self, action: Action, session: int) -> None:
        if action.execute_waypoint_list is not None and errors(action.execute_waypoint_list, self.arm.joints):
            raise Rejected(INVALID)
        self.arm.execute(action, session)

    def _execute_waypoints(self, ways: WaypointList, session: int) -> None:
        self._execute(Action(name="waypoints", execute_waypoint_list=ways), session)

    def _execute_known(self, handle: ActionHandle, session: int) -> None:
        if handle.identifier != 2:
            raise Rejected(NOT_FOUND)
        self.arm.execute(_HOME, session)

    def _validate(self, ways: WaypointList) -> ValidationReport:
        joints = self.arm.joints
        found = errors(ways, joints) or reachable(ways, joints)
        return ValidationReport(trajectory_error_report=TrajectoryErrorReport(trajectory_error_elements=found))

    def _set_servoing(self, asked: ServoingModeInformation, _: int) -> None:
        if asked.servoing_mode not in set(ServoingMode):
            raise Rejected(INVALID)
        self.arm.servoing = asked.servoing_mode

    def _create_zone(self, zone: ProtectionZone) -> Handle:
        if not well_formed(zone):
            raise Rejected(INVALID)
        self._zones_made += 1
        handle = Handle(identifier=self._zones_made)
        self.arm.zones[handle.identifier] = dataclasses.replace(zone, handle=handle)
        return handle

    def _delete_zone(self, number: int) -> None:
        if self.arm.zones.pop(number, None) is None:
            raise Rejected(NOT_FOUND)

    def _tool(self) -> ToolConfiguration:
        """The delivered gripper; its mass is that of Robotiq's manual."""
        frame = Pose(z=self.arm.adversity.tip_m, theta_z=self.arm.adversity.turn_deg)
        return ToolConfiguration(tool_transform=frame, tool_mass=0.925, tool_mass_center=Point(z=0.058))

    def _limit_linear(self, asked: TwistLinearSoftLimit) -> None:
        mode = _mode(asked.control_mode)
        _within(asked.twist_linear_soft_limit, gen3.LINEAR_M_S)
        self.arm.soft_limits[mode] = (asked.twist_linear_soft_limit, self.arm.soft_limits[mode][1])

    def _limit_angular(self, asked: TwistAngularSoftLimit) -> None:
        mode = _mode(asked.control_mode)
        _within(asked.twist_angular_soft_limit, gen3.ANGULAR_DEG_S)
        self.arm.soft_limits[mode] = (self.arm.soft_limits[mode][0], asked.twist_angular_soft_limit)

    def _soft_limits(self, asked: ControlModeInformation) -> KinematicLimits:
        linear, angular = self.arm.soft_limits[_mode(asked.control_mode)]
        return _limits(linear, angular, asked.control_mode)


def _mode(number: int) -> ControlMode:
    if number not in set(ControlMode):
        raise Rejected(INVALID)
    return ControlMode(number)


def _within(value: float, most: float) -> None:
    above_maximum, below_minimum = 48, 49
    if not 0 < value <= most * (1 + 1e-6):
        raise Rejected(above_maximum if value > most else below_minimum)


def _limits(linear: float, angular: float, mode: int) -> KinematicLimits:
    speeds = tuple(float(each) for each in np.degrees(gen3.JOINT_SPEED))
    return KinematicLimits(control_mode=mode, twist_linear=linear, twist_angular=angular, joint_speed_limits=speeds)


def _actions(asked: RequestedActionType) -> ActionList:
    return ActionList(action_list=(_HOME,) if asked.action_type in (0, 7) else ())


def _joints(said: JointAngles) -> gen3.Joints:
    if len(said.joint_angles) != 7:
        raise Rejected(57)
    return np.radians([each.value for each in sorted(said.joint_angles, key=lambda each: each.joint_identifier)])


def _inverse(asked: InverseKinematicsData) -> JointAngles:
    found = gen3.solve_joints(gen3.transform(asked.cartesian_pose or Pose()), _joints(asked.guess or JointAngles()))
    if found is None:
        raise Rejected(56)
    angles = enumerate(np.degrees(found) % 360.0)
    return JointAngles(joint_angles=tuple(JointAngle(joint_identifier=i, value=float(each)) for i, each in angles))


def _reply(asked: KortexFrame, message: object) -> KortexFrame:
    return KortexFrame(
        kind=FrameKind.RESPONSE,
        service=asked.service,
        function=asked.function,
        session=asked.session,
        message=asked.message,
        device=asked.device,
        payload=encode(message),
    )


def _error_reply(asked: KortexFrame, code: int, sub_code: int, said: str) -> KortexFrame:
    reply = _reply(asked, ErrorReply(error_code=code, error_sub_code=sub_code, error_sub_string=said))
    return dataclasses.replace(reply, error=code, sub_error=sub_code)


def _notification(session: ArmSession, handle: int, payload: bytes) -> KortexFrame:
    return KortexFrame(
        kind=FrameKind.NOTIFICATION,
        service=Service.BASE,
        session=session.number,
        message=handle,
        payload=payload,
    )
