"""Typed calls of an arm, over either client, each with an explicit timeout."""

from collections.abc import Mapping, Sequence
from typing import final

import numpy as np
from jaxtyping import Float64

from app.core.errors import MotionRefused
from app.core.rejection_codes import Refusal
from app.rig.kinova.api import calls
from app.rig.kinova.api.codes import ArmStateCode, ControlMode, GripperMode, ReferenceFrame, ServoingMode, ShapeType
from app.rig.kinova.api.error_messages import TRAJECTORY_ERRORS
from app.rig.kinova.api.feedback import Feedback
from app.rig.kinova.api.messages import (
    Action,
    ActionHandle,
    CartesianWaypoint,
    FingerMessage,
    GripperCommand,
    GripperMessage,
    RequestedActionType,
    TrajectoryErrorReport,
    Twist,
    TwistCommand,
    Waypoint,
    WaypointList,
)
from app.rig.kinova.api.session import Empty, Handle, ServoingModeInformation
from app.rig.kinova.api.setup import (
    ControlModeInformation,
    GravityVector,
    KinematicLimits,
    PayloadInformation,
    Point,
    ProtectionZone,
    RotationMatrix,
    RotationMatrixRow,
    ToolConfiguration,
    TwistAngularSoftLimit,
    TwistLinearSoftLimit,
    ZoneShape,
)
from app.rig.kinova.client.link import Link

_EXECUTE_WAYPOINTS, _REACH_JOINTS = 41, 7
"""`ActionType` of `Base.proto`."""
_NOTHING = Empty()
_LIMITED = (ControlMode.CARTESIAN_JOYSTICK, ControlMode.CARTESIAN_TRAJECTORY, ControlMode.CARTESIAN_WAYPOINT_TRAJECTORY)


@final
class Kortex:
    """An arm, call by call. Each raises Refused, NoAnswer or LinkLost; none retries, and none waits for another."""

    def __init__(self, link: Link) -> None:
        self._link = link

    @property
    def client(self) -> str:
        """Name of the client that carries the calls."""
        return self._link.name

    @property
    def loss_reason(self) -> str:
        """Reason for the lost connection; empty while there is one."""
        return self._link.loss_reason

    def open(self) -> None:
        """Connect, and subscribe to actions, the arm's state and protection zones for `events`."""
        self._link.open()
        for topic in (calls.ACTIONS, calls.ARM_STATES, calls.PROTECTION_ZONES):
            self._link.subscribe(topic)

    def close(self) -> None:
        """End the connection."""
        self._link.close()

    def cut(self) -> None:
        """Drop the connection silently: the arm then stops the session's motions."""
        self._link.cut()

    def events(self) -> list[object]:
        """Notifications of actions, the arm's state and protection zones since the last call.

        They are polled, so that the reader may make calls.
        """
        return self._link.take_notifications()

    def keep_alive(self) -> None:
        """Send a sign of life without waiting for an answer: without any the arm stops the session's motions."""
        self._link.tell(calls.KEEP_ALIVE, _NOTHING)

    def feedback(self) -> Feedback:
        """The arm's current measurements, over UDP."""
        return self._link.call(calls.REFRESH_FEEDBACK, _NOTHING)

    def state(self) -> int:
        """An `ArmStateCode`, or one of a newer firmware."""
        return self._link.call(calls.GET_ARM_STATE, _NOTHING).active_state

    def ready(self) -> bool:
        """True where it accepts commands."""
        return self.state() in (ArmStateCode.SERVOING_READY, ArmStateCode.IDLE)

    def joint_count(self) -> int:
        """Number of joints: 7, or 6."""
        return self._link.call(calls.GET_ACTUATOR_COUNT, _NOTHING).count

    def firmware(self) -> str:
        """Version of the firmware."""
        return self._link.call(calls.GET_FIRMWARE_BUNDLE_VERSIONS, _NOTHING).main_bundle_version

    def servo(self, mode: ServoingMode = ServoingMode.SINGLE_LEVEL) -> None:
        """Have the arm close its own loop. Its mode outlives sessions, so it must not be assumed."""
        self._link.call(calls.SET_SERVOING_MODE, ServoingModeInformation(servoing_mode=mode))

    def check(self, ways: Sequence[CartesianWaypoint]) -> None:
        """Have the arm validate waypoints without moving. Raises MotionRefused with their errors."""
        report = self._link.call(calls.VALIDATE_WAYPOINT_LIST, _list(ways)).trajectory_error_report
        if found := (report or TrajectoryErrorReport()).trajectory_error_elements:
            said = "; ".join(
                f"waypoint {each.waypoint_index + 1} {TRAJECTORY_ERRORS.get(each.error_type, 'is invalid')}"
                + (f" ({each.message})" if each.message else "")
                for each in found[:3]
            )
            raise MotionRefused(Refusal.UNREACHABLE, f"The arm would not go this way: {said}. Plan another.")

    def go(self, ways: Sequence[CartesianWaypoint], name: str = "dipac") -> None:
        """Start along waypoints, as an action whose events report its progress. `check` them first."""
        handle = ActionHandle(action_type=_EXECUTE_WAYPOINTS)
        self._link.call(calls.EXECUTE_ACTION, Action(name=name, handle=handle, execute_waypoint_list=_list(ways)))

    def go_home(self) -> None:
        """Start towards the arm's stored pose Home. Raises MotionRefused where it has none."""
        known = self._link.call(calls.READ_ALL_ACTIONS, RequestedActionType(action_type=_REACH_JOINTS)).action_list
        home = next((each.handle for each in known if each.name == "Home" and each.handle), None)
        if home is None:
            raise MotionRefused(Refusal.DEVICE, "The arm keeps no action of the name Home; make one in its web page.")
        self._link.call(calls.EXECUTE_ACTION_FROM_REFERENCE, home)

    def pause(self) -> None:
        """Pause an action."""
        self._link.call(calls.PAUSE_ACTION, _NOTHING)

    def resume(self) -> None:
        """Resume an action."""
        self._link.call(calls.RESUME_ACTION, _NOTHING)

    def twist(self, linear: Float64[np.ndarray, "3"], angular: Float64[np.ndarray, "3"]) -> None:
        """Move at a constant velocity [m/s, rad/s] in the base's frame, until another command.

        The arm ignores durations. The caller must end it by `stop`, even where it fails itself.
        """
        x, y, z = (float(each) for each in linear)
        rx, ry, rz = (float(each) for each in np.degrees(angular))
        twist = Twist(linear_x=x, linear_y=y, linear_z=z, angular_x=rx, angular_y=ry, angular_z=rz)
        self._link.call(calls.SEND_TWIST_COMMAND, TwistCommand(reference_frame=ReferenceFrame.BASE, twist=twist))

    def stop(self, timeout_s: float | None = None) -> None:
        """Stop any motion. Waits for no other call."""
        self._link.call(calls.STOP, _NOTHING, timeout_s=timeout_s)

    def emergency_stop(self, timeout_s: float | None = None) -> None:
        """Stop at once and fall into fault; `clear_faults` ends that."""
        self._link.call(calls.APPLY_EMERGENCY_STOP, _NOTHING, timeout_s=timeout_s)

    def clear_faults(self) -> None:
        """Leave the fault, where its cause is gone."""
        self._link.call(calls.CLEAR_FAULTS, _NOTHING)

    def grip(self, closed: float) -> None:
        """Move the fingers: 0 open to 1 closed."""
        self._grip(GripperMode.POSITION, closed)

    def grip_on(self, speed: float) -> None:
        """Move the fingers continuously, at a share of their full speed: above 0 opens."""
        self._grip(GripperMode.SPEED, speed)

    def gripper_closure(self) -> float:
        """Closure of the fingers, 0 to 1."""
        motors = getattr(getattr(self.feedback().interconnect, "gripper_feedback", None), "motor", ())
        return motors[0].position / 100.0 if motors else 0.0

    def hard_limits(self) -> KinematicLimits:
        """Hard limits of the arm [m/s, degrees/s]."""
        return self._link.call(calls.GET_KINEMATIC_HARD_LIMITS, _NOTHING)

    def limit(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Set the arm's own limits of its tool's speed, for twists and for waypoints."""
        for mode in _LIMITED:
            self._limit(mode, linear_m_s, float(np.degrees(angular_rad_s)))

    def limits(self) -> Mapping[ControlMode, tuple[float, float]]:
        """The arm's own limits of its tool's speed [m/s, degrees/s], in each mode that `limit` sets."""
        found = {mode: self._soft_limits(mode) for mode in _LIMITED}
        return {mode: (limits.twist_linear, limits.twist_angular) for mode, limits in found.items()}

    def limit_as(self, limits: Mapping[ControlMode, tuple[float, float]]) -> None:
        """Set the limits that `limits` returned before."""
        for mode, (linear, angular) in limits.items():
            self._limit(mode, linear, angular)

    def configuration(self) -> tuple[ToolConfiguration, PayloadInformation, GravityVector]:
        """Configured tool, payload and gravity of the arm."""
        return (
            self._link.call(calls.GET_TOOL_CONFIGURATION, _NOTHING),
            self._link.call(calls.GET_PAYLOAD_INFORMATION, _NOTHING),
            self._link.call(calls.GET_GRAVITY_VECTOR, _NOTHING),
        )

    def forbid(
        self, name: str, middle: Sequence[float], sizes: Sequence[float], turn: Float64[np.ndarray, "3 3"] | None = None
    ) -> int:
        """Create a box that Cartesian motions may not enter; joint motions may (ros_kortex #120). Returns its number.

        `turn`: rotation from the box's axes to those of the base; None for none.
        """
        x, y, z = (float(each) for each in middle)
        dimensions = tuple(float(each) for each in sizes)
        shape = ZoneShape(
            shape_type=ShapeType.RECTANGULAR_PRISM,
            origin=Point(x=x, y=y, z=z),
            orientation=None if turn is None or np.array_equal(turn, np.eye(3)) else _matrix(turn),
            dimensions=dimensions,
        )
        zone = ProtectionZone(name=name, is_enabled=True, shape=shape)
        return self._link.call(calls.CREATE_PROTECTION_ZONE, zone).identifier

    def forbidden(self) -> dict[str, int]:
        """Numbers of the protection zones by name."""
        zones = self._link.call(calls.READ_ALL_PROTECTION_ZONES, _NOTHING).protection_zones
        return {zone.name: zone.handle.identifier for zone in zones if zone.handle}

    def allow(self, number: int) -> None:
        """Remove a protection zone."""
        self._link.call(calls.DELETE_PROTECTION_ZONE, Handle(identifier=number))

    def _soft_limits(self, mode: ControlMode) -> KinematicLimits:
        return self._link.call(calls.GET_KINEMATIC_SOFT_LIMITS, ControlModeInformation(control_mode=mode))

    def _limit(self, mode: ControlMode, linear_m_s: float, angular_deg_s: float) -> None:
        linear = TwistLinearSoftLimit(control_mode=mode, twist_linear_soft_limit=linear_m_s)
        self._link.call(calls.SET_TWIST_LINEAR_SOFT_LIMIT, linear)
        turning = TwistAngularSoftLimit(control_mode=mode, twist_angular_soft_limit=angular_deg_s)
        self._link.call(calls.SET_TWIST_ANGULAR_SOFT_LIMIT, turning)

    def _grip(self, mode: GripperMode, value: float) -> None:
        gripper = GripperMessage(finger=(FingerMessage(finger_identifier=1, value=value),))
        self._link.call(calls.SEND_GRIPPER_COMMAND, GripperCommand(mode=mode, gripper=gripper))


def _matrix(turn: Float64[np.ndarray, "3 3"]) -> RotationMatrix:
    first, second, third = (RotationMatrixRow(column1=a, column2=b, column3=c) for a, b, c in turn.tolist())
    return RotationMatrix(row1=first, row2=second, row3=third)


def _list(ways: Sequence[CartesianWaypoint]) -> WaypointList:
    return WaypointList(waypoints=tuple(Waypoint(name=f"{n}", cartesian_waypoint=way) for n, way in enumerate(ways)))
