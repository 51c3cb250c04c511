"""What this program asks of an arm, over whichever client: small, typed, and an explicit end to every wait."""

from collections.abc import Mapping, Sequence
from typing import final

import numpy as np
from jaxtyping import Float64

from app.core.errors import MotionRefused
from app.core.refusal import Refusal
from app.rig.kinova import calls
from app.rig.kinova.codes import ArmStateCode, ControlMode, GripperMode, ReferenceFrame, ServoingMode, Shape
from app.rig.kinova.feedback import Feedback
from app.rig.kinova.link import Link
from app.rig.kinova.messages import (
    Action,
    ActionHandle,
    CartesianWaypoint,
    Finger,
    Gripper,
    GripperCommand,
    RequestedActionType,
    TrajectoryErrorReport,
    Twist,
    TwistCommand,
    Waypoint,
    WaypointList,
)
from app.rig.kinova.session import Empty, Handle, ServoingModeInformation
from app.rig.kinova.setup import (
    ControlModeInformation,
    GravityVector,
    KinematicLimits,
    PayloadInformation,
    Point,
    ProtectionZone,
    RotationMatrix,
    Row,
    ToolConfiguration,
    TwistAngularSoftLimit,
    TwistLinearSoftLimit,
    ZoneShape,
)
from app.rig.kinova.words import TRAJECTORY_ERRORS

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
        """Which client carries the calls."""
        return self._link.name

    @property
    def lost(self) -> str:
        """Why there is no connection; empty while there is."""
        return self._link.lost

    def open(self) -> None:
        """Connect, and have `events` hear of actions, the arm's state and protection zones."""
        self._link.open()
        for topic in (calls.ACTIONS, calls.ARM_STATES, calls.PROTECTION_ZONES):
            self._link.subscribe(topic)

    def close(self) -> None:
        """End the connection."""
        self._link.close()

    def cut(self) -> None:
        """Drop it without a word: of sessions that are silent the arm stops what it moves."""
        self._link.cut()

    def events(self) -> list[object]:
        """What happened since this was asked last to actions, the arm's state and protection zones, as notifications.

        They are polled, so that whoever reads them may make calls.
        """
        return self._link.told()

    def keep_alive(self) -> None:
        """Say that this session is there, and wait for nothing: where nothing is said the arm stops what it moves."""
        self._link.tell(calls.KEEP_ALIVE, _NOTHING)

    def feedback(self) -> Feedback:
        """What the arm measures now, over UDP."""
        return self._link.call(calls.REFRESH_FEEDBACK, _NOTHING)

    def state(self) -> int:
        """An `ArmStateCode`, or one of a newer firmware."""
        return self._link.call(calls.GET_ARM_STATE, _NOTHING).active_state

    def ready(self) -> bool:
        """Whether it may be commanded."""
        return self.state() in (ArmStateCode.SERVOING_READY, ArmStateCode.IDLE)

    def joint_count(self) -> int:
        """How many joints it has: 7, or 6."""
        return self._link.call(calls.GET_ACTUATOR_COUNT, _NOTHING).count

    def firmware(self) -> str:
        """Its version."""
        return self._link.call(calls.GET_FIRMWARE_BUNDLE_VERSIONS, _NOTHING).main_bundle_version

    def servo(self, mode: ServoingMode = ServoingMode.SINGLE_LEVEL) -> None:
        """Have the arm close its own loop. Its mode outlives sessions, so nobody may take it for granted."""
        self._link.call(calls.SET_SERVOING_MODE, ServoingModeInformation(servoing_mode=mode))

    def check(self, ways: Sequence[CartesianWaypoint]) -> None:
        """Have the arm try a way without moving. Raises MotionRefused with what is wrong with it."""
        report = self._link.call(calls.VALIDATE_WAYPOINT_LIST, _list(ways)).trajectory_error_report
        if found := (report or TrajectoryErrorReport()).trajectory_error_elements:
            said = "; ".join(
                f"waypoint {each.waypoint_index + 1} {TRAJECTORY_ERRORS.get(each.error_type, 'is invalid')}"
                + (f" ({each.message})" if each.message else "")
                for each in found[:3]
            )
            raise MotionRefused(Refusal.UNREACHABLE, f"The arm would not go this way: {said}. Plan another.")

    def go(self, ways: Sequence[CartesianWaypoint], name: str = "dipac") -> None:
        """Set out along waypoints, as an action whose events say how it goes. `check` them before."""
        handle = ActionHandle(action_type=_EXECUTE_WAYPOINTS)
        self._link.call(calls.EXECUTE_ACTION, Action(name=name, handle=handle, execute_waypoint_list=_list(ways)))

    def go_home(self) -> None:
        """Set out to the pose that the arm keeps as Home. Raises MotionRefused where it keeps none."""
        known = self._link.call(calls.READ_ALL_ACTIONS, RequestedActionType(action_type=_REACH_JOINTS)).action_list
        home = next((each.handle for each in known if each.name == "Home" and each.handle), None)
        if home is None:
            raise MotionRefused(Refusal.DEVICE, "The arm keeps no action of the name Home; make one in its web page.")
        self._link.call(calls.EXECUTE_ACTION_FROM_REFERENCE, home)

    def pause(self) -> None:
        """Let an action stand."""
        self._link.call(calls.PAUSE_ACTION, _NOTHING)

    def resume(self) -> None:
        """Let it go on."""
        self._link.call(calls.RESUME_ACTION, _NOTHING)

    def twist(self, linear: Float64[np.ndarray, "3"], angular: Float64[np.ndarray, "3"]) -> None:
        """Move on and on like that [m/s, rad/s] in the base's frame, until something else is said.

        The arm heeds no duration. Whoever calls this has to see to the end by `stop`, even where it fails itself.
        """
        x, y, z = (float(each) for each in linear)
        rx, ry, rz = (float(each) for each in np.degrees(angular))
        twist = Twist(linear_x=x, linear_y=y, linear_z=z, angular_x=rx, angular_y=ry, angular_z=rz)
        self._link.call(calls.SEND_TWIST_COMMAND, TwistCommand(reference_frame=ReferenceFrame.BASE, twist=twist))

    def stop(self, timeout_s: float | None = None) -> None:
        """Stop whatever moves. Waits for no other call."""
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
        """Move the fingers on and on, as a share of their full speed: above 0 opens."""
        self._grip(GripperMode.SPEED, speed)

    def gripped(self) -> float:
        """How far the fingers are closed, 0 to 1."""
        motors = getattr(getattr(self.feedback().interconnect, "gripper_feedback", None), "motor", ())
        return motors[0].position / 100.0 if motors else 0.0

    def hard_limits(self) -> KinematicLimits:
        """What the arm may do at most [m/s, degrees/s]."""
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
        """Set them to what `limits` said before."""
        for mode, (linear, angular) in limits.items():
            self._limit(mode, linear, angular)

    def configured(self) -> tuple[ToolConfiguration, PayloadInformation, GravityVector]:
        """What the arm believes of its tool, of what that holds, and of which way things fall."""
        return (
            self._link.call(calls.GET_TOOL_CONFIGURATION, _NOTHING),
            self._link.call(calls.GET_PAYLOAD_INFORMATION, _NOTHING),
            self._link.call(calls.GET_GRAVITY_VECTOR, _NOTHING),
        )

    def forbid(
        self, name: str, middle: Sequence[float], sizes: Sequence[float], turn: Float64[np.ndarray, "3 3"] | None = None
    ) -> int:
        """Make a box that Cartesian motions may not enter; joint motions may (ros_kortex #120). Its number.

        `turn`: from the box's axes to those of the base, which they are where it is None or turns nothing.
        """
        x, y, z = (float(each) for each in middle)
        dimensions = tuple(float(each) for each in sizes)
        shape = ZoneShape(
            shape_type=Shape.RECTANGULAR_PRISM,
            origin=Point(x=x, y=y, z=z),
            orientation=None if turn is None or np.array_equal(turn, np.eye(3)) else _matrix(turn),
            dimensions=dimensions,
        )
        zone = ProtectionZone(name=name, is_enabled=True, shape=shape)
        return self._link.call(calls.CREATE_PROTECTION_ZONE, zone).identifier

    def forbidden(self) -> dict[str, int]:
        """The boxes by name."""
        zones = self._link.call(calls.READ_ALL_PROTECTION_ZONES, _NOTHING).protection_zones
        return {zone.name: zone.handle.identifier for zone in zones if zone.handle}

    def allow(self, number: int) -> None:
        """Remove one of them."""
        self._link.call(calls.DELETE_PROTECTION_ZONE, Handle(identifier=number))

    def _soft_limits(self, mode: ControlMode) -> KinematicLimits:
        return self._link.call(calls.GET_KINEMATIC_SOFT_LIMITS, ControlModeInformation(control_mode=mode))

    def _limit(self, mode: ControlMode, linear_m_s: float, angular_deg_s: float) -> None:
        linear = TwistLinearSoftLimit(control_mode=mode, twist_linear_soft_limit=linear_m_s)
        self._link.call(calls.SET_TWIST_LINEAR_SOFT_LIMIT, linear)
        turning = TwistAngularSoftLimit(control_mode=mode, twist_angular_soft_limit=angular_deg_s)
        self._link.call(calls.SET_TWIST_ANGULAR_SOFT_LIMIT, turning)

    def _grip(self, mode: GripperMode, value: float) -> None:
        gripper = Gripper(finger=(Finger(finger_identifier=1, value=value),))
        self._link.call(calls.SEND_GRIPPER_COMMAND, GripperCommand(mode=mode, gripper=gripper))


def _matrix(turn: Float64[np.ndarray, "3 3"]) -> RotationMatrix:
    first, second, third = (Row(column1=a, column2=b, column3=c) for a, b, c in turn.tolist())
    return RotationMatrix(row1=first, row2=second, row3=third)


def _list(ways: Sequence[CartesianWaypoint]) -> WaypointList:
    return WaypointList(waypoints=tuple(Waypoint(name=f"{n}", cartesian_waypoint=way) for n, way in enumerate(ways)))
