"""State machine of the emulated arm: modes, actions, faults. No socket, no clock."""

import dataclasses
from collections.abc import Callable
from typing import final

import numpy as np

from app.rig.kinova import gen3
from app.rig.kinova.api.codes import ActionEvent, ArmStateCode, ControlMode, ReferenceFrame, ServoingMode
from app.rig.kinova.api.error_messages import ROBOT_IN_EMERGENCY_STOP, ROBOT_IN_FAULT, SESSION_NOT_IN_CONTROL
from app.rig.kinova.api.messages import (
    Action,
    ActionHandle,
    ActionNotification,
    AngularWaypoint,
    CartesianWaypoint,
    ConstrainedJointAngles,
    GripperCommand,
    JointAngles,
    TrajectoryInfo,
    TwistCommand,
    WaypointList,
)
from app.rig.kinova.api.messages import Twist as TwistValues
from app.rig.kinova.api.session import ArmStateNotification, Handle
from app.rig.kinova.api.setup import ProtectionZone, ProtectionZoneNotification
from app.rig.kinova.emulator.adversity import FaultInjection
from app.rig.kinova.emulator.fingers import Fingers
from app.rig.kinova.emulator.motions import AlongPath, Broken, InJoints, JointMotion, Twisting
from app.rig.kinova.emulator.timed import TimedPath
from app.rig.kinova.emulator.zones import inside

CYCLE_S = 0.025
"""Period of high-level commands (kortex_driver/readme.md)."""
START: gen3.Joints = np.radians([2.444, 20.8641, 176.7349, -85.9559, 1.2141, -73.2146, -0.9581])
"""Start configuration: the tool points down, at (0.45, 0, 0.3) m."""
STOPPED, BROKEN_OFF, WRONG_MODE, INVALID, NOT_FOUND = 55, 140, 75, 3, 17
"""Sub errors of `Errors.proto`."""
EMERGENCY_STOP_BIT, ENTERING_ZONE, ZONE_REACHED = 1 << 23, 11, 1
ANOTHER = 0xFFFF
"""Connection number that is not one of this process."""
Notification = ActionNotification | ArmStateNotification | ProtectionZoneNotification


class Rejected(Exception):
    """A call is answered with an error."""

    def __init__(self, sub_code: int) -> None:
        super().__init__(f"sub error {sub_code}")
        self.sub_code = sub_code


@final
class FakeArm:
    """Joints [rad], fingers, faults and motion between two ticks. `told`: notifications due to subscribers."""

    def __init__(self) -> None:
        self.joints, self.velocity = START.copy(), np.zeros(7)
        self.fingers, self.adversity = Fingers(), FaultInjection()
        self.servoing: int = ServoingMode.SINGLE_LEVEL
        self.base_faults, self.joint_faults, self.lasting = 0, [0] * 7, False
        self.zones: dict[int, ProtectionZone] = {}
        self.soft_limits = dict.fromkeys(ControlMode, (gen3.LINEAR_M_S, gen3.ANGULAR_DEG_S))
        self.told: list[Notification] = []
        self.mover = 0
        self._now_s = self._next_s = 0.0
        self._goal_upload: list[Callable[[], None]] = []
        self._due: tuple[float, Action, Callable[[], JointMotion | None]] | None = None
        self._action: ActionHandle | None = None
        self._motion: JointMotion | None = None
        self._actions = 0
        self._stopping = False
        self._state = self.state

    @property
    def state(self) -> ArmStateCode:
        """State that the arm reports."""
        if self.base_faults or any(self.joint_faults):
            return ArmStateCode.IN_FAULT
        if self.servoing == ServoingMode.LOW_LEVEL:
            return ArmStateCode.SERVOING_LOW_LEVEL
        if self._action is not None:
            return ArmStateCode.SERVOING_PLAYING_SEQUENCE
        return ArmStateCode.SERVOING_MANUALLY_CONTROLLED if self._motion else ArmStateCode.SERVOING_READY

    @property
    def moving(self) -> bool:
        """True while any joint moves or is about to."""
        return self._motion is not None or self._due is not None or bool(self._goal_upload)

    def execute(self, action: Action, session: int) -> None:
        """Begin an action after its planning time; events report its progress. Raises Denied."""
        self._check(session)
        begin = self._beginning(action)
        self._actions += 1
        handle = ActionHandle(identifier=self._actions, action_type=action.handle.action_type if action.handle else 0)
        named = Action(handle=handle, name=action.name)
        self._goal_upload.append(lambda: self._think(named, begin))

    def twist(self, command: TwistCommand, session: int) -> None:
        """Move at a constant velocity without end. Raises Denied."""
        self._check(session)
        self._goal_upload.append(lambda: self._twist(command))

    def close_fingers(self, command: GripperCommand, session: int) -> None:
        """Execute a gripper command. Raises Denied."""
        self._check(session)
        if command.gripper is None or not command.gripper.finger or command.mode not in (2, 3):
            raise Rejected(INVALID)
        self.fingers.command(command)

    def stop(self) -> None:
        """Bring any motion to rest, whichever session commanded it."""
        self._goal_upload.append(self._stop)

    def pause(self) -> None:
        """Hold an action until it is resumed."""
        if self._motion is not None:
            self._motion.brake()
            self._say(ActionEvent.PAUSE)

    def resume(self) -> None:
        """Resume a paused action."""
        if isinstance(self._motion, AlongPath):
            self._motion.go_on()
            self._say(ActionEvent.START)

    def emergency_stop(self) -> None:
        """Enter fault at once."""
        self.fail(base=EMERGENCY_STOP_BIT)

    def take_over(self, speed_m_s: float) -> None:
        """Have another session take control and move the tool upwards without end; the current action is aborted.

        The user guide says that a gamepad or the wrist's buttons always do; that an action ends so was reported
        (ros_kortex #144).
        """
        self.adversity = dataclasses.replace(self.adversity, foreign=True)
        self._goal_upload.append(lambda: self._obey_another(TwistValues(linear_z=speed_m_s)))

    def fail(self, *, base: int = 0, joint: int = 0, bits: int = 0, lasting: bool = False) -> None:
        """Set bits of the base's bank, or of a joint's from 1; `lasting` ones cannot be cleared yet."""
        self.base_faults |= base | (1 << 4 if bits else 0)
        if bits:
            self.joint_faults[joint - 1] |= bits
        self.lasting = lasting
        estop = self.base_faults & EMERGENCY_STOP_BIT
        self._drop(ROBOT_IN_EMERGENCY_STOP if estop else ROBOT_IN_FAULT)
        # Pending actions are dropped too, each by itself.
        waiting, self._goal_upload = self._goal_upload, []
        for command in waiting:
            command()
        self.fingers.stop()
        self._note_state()

    def clear_faults(self) -> None:
        """Leave the fault, where its cause is gone."""
        if not self.lasting:
            self.base_faults, self.joint_faults = 0, [0] * 7
            self._note_state()

    def tick(self, now_s: float, duration_s: float) -> None:
        """Advance time."""
        self._now_s = now_s
        if now_s >= self._next_s:
            self._next_s = max(self._next_s + CYCLE_S, now_s)
            goal_upload, self._goal_upload = self._goal_upload, []
            for command in goal_upload:
                command()
        if self._due is not None and now_s >= self._due[0]:
            self._start()
        self._move(duration_s)
        self.fingers.advance(duration_s, self.adversity.object_at)
        self._note_state()

    def _note_state(self) -> None:
        """Notify subscribers of a changed state."""
        if self.state != self._state:
            self._state = self.state
            self.told.append(ArmStateNotification(active_state=self._state))

    def _check(self, session: int) -> None:
        """Raise Denied where the arm would not move now for this session."""
        if self.base_faults & EMERGENCY_STOP_BIT:
            raise Rejected(ROBOT_IN_EMERGENCY_STOP)
        if self.state == ArmStateCode.IN_FAULT:
            raise Rejected(ROBOT_IN_FAULT)
        if self.servoing != ServoingMode.SINGLE_LEVEL:
            raise Rejected(WRONG_MODE)
        if self.adversity.foreign:
            raise Rejected(SESSION_NOT_IN_CONTROL)
        self.mover = session

    def _beginning(self, action: Action) -> Callable[[], JointMotion | None]:
        """Start of an action after its planning time; it returns None where it moves the fingers alone."""
        if (ways := action.execute_waypoint_list) is not None and ways.waypoints:
            return lambda: self._along(ways)
        if (joints := action.reach_joint_angles) is not None:
            return lambda: InJoints(self.joints, [_angles(joints, self.joints)], [0.0])
        if (command := action.send_gripper_command) is not None and command.gripper and command.gripper.finger:
            return lambda: self.fingers.command(command)
        raise Rejected(INVALID)

    def _along(self, ways: WaypointList) -> JointMotion:
        cartesian = tuple(each.cartesian_waypoint for each in ways.waypoints if each.cartesian_waypoint)
        if cartesian:
            linear, angular = self.soft_limits[ControlMode.CARTESIAN_WAYPOINT_TRAJECTORY]
            slow = tuple(_slow_down(each, linear, angular) for each in cartesian)
            return AlongPath(TimedPath(gen3.tool(self.joints), slow), short_m=self.adversity.short_m)
        angular = [each.angular_waypoint or AngularWaypoint() for each in ways.waypoints]
        targets = [_unwrap(np.radians(each.angles), self.joints) for each in angular]
        return InJoints(self.joints, targets, [each.duration for each in angular])

    def _think(self, action: Action, begin: Callable[[], JointMotion | None]) -> None:
        self._drop(STOPPED)
        self._action = action.handle
        self._say(ActionEvent.PREPROCESS_START)
        if self.base_faults:
            self._end(ActionEvent.ABORT, ROBOT_IN_FAULT)
            return
        self._due = (self._now_s + self.adversity.thinks_s, action, begin)

    def _start(self) -> None:
        assert self._due is not None
        _, _, begin = self._due
        self._due = None
        self._say(ActionEvent.PREPROCESS_END)
        self._say(ActionEvent.START)
        self._stopping = False
        self._motion = begin()

    def _twist(self, command: TwistCommand) -> None:
        if self.base_faults:
            return
        if not isinstance(self._motion, Twisting):
            self._drop(STOPPED)
            self._motion = Twisting()
            self._stopping = False
        linear, angular = self.soft_limits[ControlMode.CARTESIAN_JOYSTICK]
        frame, tool = command.reference_frame, gen3.tool(self.joints)
        self._motion.aim(command.twist or TwistValues(), frame, tool, linear, angular)

    def _obey_another(self, twist: TwistValues) -> None:
        self._drop(SESSION_NOT_IN_CONTROL)
        self.mover, self._motion, self._stopping = ANOTHER, Twisting(), False
        linear, angular = self.soft_limits[ControlMode.CARTESIAN_JOYSTICK]
        self._motion.aim(twist, ReferenceFrame.BASE, gen3.tool(self.joints), linear, angular)

    def _stop(self) -> None:
        self.fingers.stop()
        if self._due is not None:
            self._drop(STOPPED)
        elif self._motion is not None:
            self._motion.brake()
            self._stopping = True

    def _move(self, duration_s: float) -> None:
        before = self.joints
        if (motion := self._motion) is not None and not self.adversity.stuck:
            try:
                self._step(motion, duration_s)
            except Broken as broken:
                self._drop(BROKEN_OFF, broken.info)
        self.velocity = (self.joints - before) / duration_s
        if self._motion is None and self._action is not None and self._due is None and not self.fingers.moving:
            self._end(ActionEvent.END)
        elif self._motion is not None and self._motion.over and not self._standing():
            stopped, self._motion = self._stopping, None
            if self._action is not None:
                self._end(ActionEvent.ABORT, STOPPED) if stopped else self._end(ActionEvent.END)

    def _standing(self) -> bool:
        """True where an action is paused and may go on."""
        return isinstance(self._motion, AlongPath) and self._motion.is_paused and not self._stopping

    def _step(self, motion: JointMotion, duration_s: float) -> None:
        moved = motion.advance(self.joints, duration_s)
        if motion.cartesian:
            for number, zone in self.zones.items():
                if inside(zone, gen3.tool(moved)[:3, 3]) and not inside(zone, gen3.tool(self.joints)[:3, 3]):
                    self.told.append(_zone_notification(number))
                    raise Broken(ENTERING_ZONE)
        self.joints = moved

    def _drop(self, details: int, info: int = 0) -> None:
        """Abort the current action, if any, at once."""
        self._motion = self._due = None
        if self._action is not None:
            self._end(ActionEvent.ABORT, details, info)

    def _end(self, event: ActionEvent, details: int = 0, info: int = 0) -> None:
        self._say(event, details, info)
        self._action = None

    def _say(self, event: ActionEvent, details: int = 0, info: int = 0) -> None:
        infos = (TrajectoryInfo(trajectory_info_type=info),) if info else ()
        self.told.append(
            ActionNotification(action_event=event, handle=self._action, abort_details=details, trajectory_info=infos)
        )


def _slow_down(waypoint: CartesianWaypoint, linear_m_s: float, angular_deg_s: float) -> CartesianWaypoint:
    """The waypoint within the soft limits; one without a speed gets the highest that they allow."""
    return dataclasses.replace(
        waypoint,
        maximum_linear_velocity=min(waypoint.maximum_linear_velocity or linear_m_s, linear_m_s),
        maximum_angular_velocity=min(waypoint.maximum_angular_velocity or angular_deg_s, angular_deg_s),
    )


def _zone_notification(number: int) -> ProtectionZoneNotification:
    return ProtectionZoneNotification(event=ZONE_REACHED, handle=Handle(identifier=number))


def _angles(said: ConstrainedJointAngles, now: gen3.Joints) -> gen3.Joints:
    """Target joints; those not given stay as they are."""
    target = now.copy()
    for each in (said.joint_angles or JointAngles()).joint_angles:
        target[each.joint_identifier] = np.radians(each.value)
    return _unwrap(target, now)


def _unwrap(target: gen3.Joints, now: gen3.Joints) -> gen3.Joints:
    """The same angles, the nearer way round for continuous joints: the arm reports 0 to 360 degrees."""
    near, within = now + np.angle(np.exp(1j * (target - now))), np.angle(np.exp(1j * target))
    return np.where(np.isfinite(gen3.RANGE), within, near)
