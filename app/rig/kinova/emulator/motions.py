"""Motions of the emulated arm: along a Cartesian path, through joint angles, or at a constant twist."""

from collections.abc import Sequence
from typing import Protocol, final

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.types import Transform
from app.rig.kinova import gen3
from app.rig.kinova.api.codes import ReferenceFrame
from app.rig.kinova.api.messages import Twist
from app.rig.kinova.emulator.timed import TimedPath
from app.rig.kinova.gen3 import Joints

STOP_M_S2, TWIST_M_S2, TWIST_RAD_S2 = 2.5, 2.0, 8.0
"""Braking deceleration, and accelerations of a twist; assumed, Kinova publishes none."""
_LOST_M, _LOST_S, _SETTLED = 0.02, 0.3, 1e-3
"""Following error [m] and its duration [s] that abort a motion, and the error at which it has settled [m and rad]."""
_STEPS = 3


class Broken(Exception):
    """Abort of a motion; `info` is the `TrajectoryInfoType`."""

    def __init__(self, info: int) -> None:
        super().__init__(f"trajectory info {info}")
        self.info = info


class JointMotion(Protocol):
    """A motion of the joints over time."""

    cartesian: bool

    def advance(self, joints: Joints, duration_s: float) -> Joints:
        """The joints `duration_s` later. Raises Broken where it cannot go on."""
        ...

    def brake(self) -> None:
        """Decelerate to rest."""
        ...

    @property
    def over(self) -> bool:
        """True once at rest, at its end or after braking."""
        ...


def limit(before: Joints, after: Joints, duration_s: float) -> Joints:
    """`after`, or as far towards it as the joints' speeds allow."""
    change = after - before
    worst = float((np.abs(change) / (gen3.JOINT_SPEED * duration_s)).max())
    return before + change / max(worst, 1.0)


@final
class AlongPath:
    """Motion along a timed path of the tool, whose clock slows down to brake, and resumes after a pause."""

    cartesian = True

    def __init__(self, path: TimedPath, *, short_m: float = 0.0) -> None:
        self.path = path
        self._end_s = path.short_of_end_s(short_m)
        self._time_s = self._lost_s = self._waited_s = 0.0
        self._rate = 1.0
        self._rising = True
        self._settled = False

    def advance(self, joints: Joints, duration_s: float) -> Joints:
        """Follow the path by inverse kinematics, as fast as the joints can."""
        speed = max(self.path.speed(self._time_s), 0.02)
        change = STOP_M_S2 / speed * duration_s
        self._rate = float(np.clip(self._rate + (change if self._rising else -change), 0.0, 1.0))
        self._time_s = min(self._time_s + self._rate * duration_s, self._end_s)
        target, found = self.path.at(self._time_s), joints
        for _ in range(_STEPS):
            found = gen3.nearer(found, target)
        moved = limit(joints, found, duration_s)
        self._judge(moved, target, duration_s)
        return moved

    def brake(self) -> None:
        """Decelerate to rest."""
        self._rising = False

    def go_on(self) -> None:
        """Resume after a pause."""
        self._rising = True

    @property
    def is_paused(self) -> bool:
        """True while it is paused and may resume."""
        return not self._rising and self._rate == 0.0

    @property
    def over(self) -> bool:
        """True once at rest."""
        return self.is_paused or (self._time_s >= self._end_s and self._settled)

    def _judge(self, joints: Joints, target: Transform, duration_s: float) -> None:
        """Update the settled state; raise Broken where the following error has lasted too long."""
        off = float(np.abs(gen3.away(gen3.frames(joints), target)).max())
        self._settled = off < _SETTLED
        ended = self._time_s >= self._end_s
        self._lost_s = self._lost_s + duration_s if off > _LOST_M else 0.0
        self._waited_s = self._waited_s + duration_s if ended and not self._settled else 0.0
        if max(self._lost_s, self._waited_s - 1.0) > _LOST_S:
            at_end = bool((np.abs(joints) >= gen3.RANGE - 1e-6).any())
            raise Broken(3 if at_end else 6)


@final
class InJoints:
    """Motion through joint angles in order, synchronised to the slowest joint."""

    cartesian = False
    _SMOOTH = 1.5
    """Ratio of peak to mean speed of the cubic."""

    def __init__(self, start: Joints, targets: Sequence[Joints], durations_s: Sequence[float]) -> None:
        self._stops = [start, *targets]
        self._lasts = [
            max(asked, self._SMOOTH * float((np.abs(end - begin) / gen3.JOINT_SPEED).max()), 0.02)
            for begin, end, asked in zip(self._stops, self._stops[1:], durations_s, strict=False)
        ]
        self._leg, self._time_s, self._rate = 0, 0.0, 1.0
        self._braking = False

    def advance(self, joints: Joints, duration_s: float) -> Joints:
        """Follow a cubic from rest to rest."""
        if self._braking:
            self._rate = max(0.0, self._rate - 5.0 * duration_s)
        self._time_s += self._rate * duration_s
        if self._time_s >= self._lasts[self._leg] and self._leg < len(self._lasts) - 1:
            self._leg, self._time_s = self._leg + 1, 0.0
        u = min(self._time_s / self._lasts[self._leg], 1.0)
        begin, end = self._stops[self._leg], self._stops[self._leg + 1]
        return limit(joints, begin + (end - begin) * (3 * u**2 - 2 * u**3), duration_s)

    def brake(self) -> None:
        """Decelerate to rest."""
        self._braking = True

    @property
    def over(self) -> bool:
        """True once at rest."""
        ended = self._leg == len(self._lasts) - 1 and self._time_s >= self._lasts[-1]
        return ended or (self._braking and self._rate == 0.0)


@final
class Twisting:
    """Motion at a constant velocity, until another command: nothing here ends by itself (ros_kortex #159)."""

    cartesian = True

    def __init__(self) -> None:
        self._wanted, self._now = np.zeros(6), np.zeros(6)

    def aim(self, twist: Twist, frame: int, tool: Transform, linear_m_s: float, angular_deg_s: float) -> None:
        """Set the velocity, clipped to the limits, with the tool's axes as they are now."""
        linear = np.array([twist.linear_x, twist.linear_y, twist.linear_z])
        angular = np.radians([twist.angular_x, twist.angular_y, twist.angular_z])
        linear *= min(1.0, linear_m_s / max(float(np.linalg.norm(linear)), 1e-9))
        angular *= min(1.0, np.radians(angular_deg_s) / max(float(np.linalg.norm(angular)), 1e-9))
        if frame == ReferenceFrame.TOOL:
            linear = tool[:3, :3] @ linear
        if frame in (ReferenceFrame.TOOL, ReferenceFrame.MIXED):
            angular = tool[:3, :3] @ angular
        self._wanted = np.concatenate([linear, angular])

    def advance(self, joints: Joints, duration_s: float) -> Joints:
        """Follow the twist by the Jacobian; slower near singular poses."""
        most = np.repeat([TWIST_M_S2, TWIST_RAD_S2], 3) * duration_s
        self._now = self._now + np.clip(self._wanted - self._now, -most, most)
        links = gen3.frames(joints)
        target = links[7].copy()
        target[:3, 3] += self._now[:3] * duration_s
        target[:3, :3] = Rotation.from_rotvec(self._now[3:] * duration_s).as_matrix() @ links[7, :3, :3]
        found = gen3.nearer(gen3.nearer(joints, target), target)
        return limit(joints, found, duration_s)

    def brake(self) -> None:
        """Decelerate to rest."""
        self._wanted = np.zeros(6)

    @property
    def over(self) -> bool:
        """True once at rest."""
        return not (self._wanted.any() or self._now.any())

    @property
    def velocity(self) -> Float64[np.ndarray, "6"]:
        """Velocity of the tool now [m/s, rad/s]."""
        return self._now
