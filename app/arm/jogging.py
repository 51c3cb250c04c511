"""A tool that is moved by hand: a velocity that changes slowly enough and dies away before a wall. Pure, no clock.

What the acceleration limit allows is shared out, so that both uses at once keep to it: half of its square for following
the hand, a sixth for each of the three axes that may have to brake before a wall at the same time.
"""

from typing import Final, final

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.config import KeepOut, Limits
from app.core.jog import Jog
from app.core.types import ToolPose

_STEERING, _BRAKING = float(np.sqrt(1 / 2)), float(np.sqrt(1 / 6))
_ROUNDING_M: Final = 1e-6
"""Walls are as much nearer than they are."""
_INSIDE_M_S: Final = 1e3
"""More than any speed: a face that the tool has passed already keeps it out of nothing while there is another."""


@final
class Jogging:
    """The tool from where it was at rest; `advance` by `advance` it follows what it was last told by `aim`.

    It slides along walls and around volumes that are kept free; one that is outside of the workspace already, or inside
    of such a volume, may only come back.
    """

    def __init__(self, tool: ToolPose, limits: Limits) -> None:
        self._tool, self._limits = tool, limits
        self._steering = limits.acceleration_m_s2 * _STEERING
        self._turning = limits.angular_acceleration_rad_s2
        # x, y, z and the opening, which has walls as well.
        self._low = np.array([*limits.workspace.low, 0.0]) + _ROUNDING_M
        self._high = np.array([*limits.workspace.high, limits.opening_m]) - _ROUNDING_M
        self._linear, self._angular, self._opening = np.zeros(3), np.zeros(3), 0.0
        self._told, self._braking = Jog(), False

    @property
    def at_rest(self) -> bool:
        """Whether it neither moves nor shall move."""
        return still(self._told) and still(Jog(linear=self._linear, angular=self._angular, opening=self._opening))

    def aim(self, jog: Jog) -> None:
        """Move so from now on; of no effect on one that brakes."""
        if not self._braking:
            self._told = Jog(
                linear=within(jog.linear, self._limits.speed_m_s),
                angular=within(jog.angular, self._limits.angular_speed_rad_s),
                opening=float(np.clip(jog.opening, -self._limits.speed_m_s, self._limits.speed_m_s)),
            )

    def brake(self, deceleration_m_s2: float) -> None:
        """Come to rest as soon as this deceleration allows, for good; turning ends as much sooner as moving does."""
        self._told, self._braking = Jog(), True
        self._turning *= deceleration_m_s2 / self._steering
        self._steering = deceleration_m_s2

    def advance(self, duration_s: float) -> ToolPose:
        """Where it is `duration_s` later."""
        told, change = self._told, self._steering * duration_s
        self._linear = self._linear + within(told.linear - self._linear, change)
        self._opening += float(np.clip(told.opening - self._opening, -change, change))
        self._angular = self._angular + within(told.angular - self._angular, self._turning * duration_s)
        self._slow_before_walls(duration_s)
        moved = self._tool[:3] + self._linear * duration_s
        turned = Rotation.from_rotvec(self._angular * duration_s) * Rotation.from_quat(
            self._tool[3:7], scalar_first=True
        )
        turn = turned.as_quat(scalar_first=True)
        # Of the two signs of a quaternion the one that is nearer to the last.
        turn = turn if turn @ self._tool[3:7] > 0 else -turn
        self._tool = np.array([*moved, *turn, self._tool[7] + self._opening * duration_s])
        return self._tool

    def _slow_before_walls(self, duration_s: float) -> None:
        """No faster towards a wall than from where it can still be met at rest."""
        at, velocity = self._tool[[0, 1, 2, 7]], np.array([*self._linear, self._opening])
        braking = self._limits.acceleration_m_s2 * _BRAKING
        fastest = _stoppable(self._high - at, braking, duration_s)
        slowest = -_stoppable(at - self._low, braking, duration_s)
        velocity = np.clip(velocity, slowest, fastest)
        self._linear, self._opening = velocity[:3], float(velocity[3])
        for volume in self._limits.keep_out:
            self._slow_before(volume, braking, duration_s)

    def _slow_before(self, volume: KeepOut, deceleration_m_s2: float, duration_s: float) -> None:
        """No faster towards one face of the volume than from where that can still be met at rest.

        A tool that stays on its side of one face stays out. It is the face for which the least has to be given up: at
        the tick before some face's bound was kept, so what is asked for now is no more than braking gives.
        """
        middle = (np.asarray(volume.low) + volume.high) / 2
        side = np.where(self._tool[:3] >= middle, 1.0, -1.0)
        face = np.where(side > 0, volume.high, volume.low) + side * _ROUNDING_M
        towards, room = -side * self._linear, side * (self._tool[:3] - face)
        most = _stoppable(room, deceleration_m_s2, duration_s)
        # Where it is inside already every bound is zero, and the nearest face is the way out.
        lost = np.maximum(towards - most, 0.0) + np.where(room >= 0, 0.0, _INSIDE_M_S - room)
        axis = int(lost.argmin())
        self._linear[axis] -= side[axis] * min(most[axis] - towards[axis], 0.0)


def within(vector: Float64[np.ndarray, "3"], length: float) -> Float64[np.ndarray, "3"]:
    """The vector, or one of that length in its direction where it is longer."""
    largest = float(np.abs(vector).max())
    # Of the largest numbers that there are the squares are none.
    vector = vector if largest <= length else vector * (length / largest)
    norm = float(np.linalg.norm(vector))
    return vector if norm <= length else vector * (length / norm)


def finite(jog: Jog) -> bool:
    """Whether every number in it is one."""
    return bool(np.isfinite([*jog.linear, *jog.angular, jog.opening]).all())


def still(jog: Jog) -> bool:
    """Whether it is none: nothing moves, turns or opens."""
    return not (jog.linear.any() or jog.angular.any() or jog.opening)


def _stoppable(
    room_m: Float64[np.ndarray, " A"], deceleration_m_s2: float, duration_s: float
) -> Float64[np.ndarray, " A"]:
    """The speeds [m/s] after whose next `duration_s` the rest of the room is enough to stop in, however long ticks are.

    The v with v t + v^2 / 2a = room: a tick later the same formula asks for at most `a` times its duration less.
    """
    step = deceleration_m_s2 * duration_s
    return np.sqrt(step**2 + 2 * deceleration_m_s2 * np.maximum(room_m, 0.0)) - step
