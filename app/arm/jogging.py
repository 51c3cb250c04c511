"""Jogging: a velocity command with limited acceleration that decays before walls. Pure, no clock.

The acceleration limit is divided so that both uses at once keep it: half of its square for following the command, a
sixth for each of the three axes that may have to brake before a wall at the same time.
"""

from functools import partial
from typing import Final, final

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.arm.walls import beside, between
from app.config import Limits
from app.core.dialogue.jog import Jog
from app.core.types import ToolPose

_STEERING, _BRAKING = float(np.sqrt(1 / 2)), float(np.sqrt(1 / 6))
_ROUNDING_M: Final = 1e-6
"""Safety margin of the walls."""


@final
class Jogging:
    """Tool pose that follows the last command of `aim`, from `advance` to `advance`, beginning at rest.

    It slides along walls and around keep-out volumes; from outside the workspace, or inside such a volume, it may only
    come back.
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
        """True where it neither moves nor is commanded to."""
        return still(self._told) and still(Jog(linear=self._linear, angular=self._angular, opening=self._opening))

    def aim(self, jog: Jog) -> None:
        """Set the commanded velocity; without effect while braking."""
        if not self._braking:
            self._told = Jog(
                linear=within(jog.linear, self._limits.speed_m_s),
                angular=within(jog.angular, self._limits.angular_speed_rad_s),
                opening=float(np.clip(jog.opening, -self._limits.speed_m_s, self._limits.speed_m_s)),
            )

    def brake(self, deceleration_m_s2: float) -> None:
        """Come to rest for good, at this deceleration; rotation ends as much sooner as translation."""
        self._told, self._braking = Jog(), True
        self._turning *= deceleration_m_s2 / self._steering
        self._steering = deceleration_m_s2

    def advance(self, duration_s: float) -> ToolPose:
        """Pose `duration_s` later."""
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
        # The quaternion's sign that is nearer to the last.
        turn = turn if turn @ self._tool[3:7] > 0 else -turn
        self._tool = np.array([*moved, *turn, self._tool[7] + self._opening * duration_s])
        return self._tool

    def _slow_before_walls(self, duration_s: float) -> None:
        """Limit the velocity towards walls and keep-out volumes to one from which the tool can stop before them."""
        at, velocity = self._tool[[0, 1, 2, 7]], np.array([*self._linear, self._opening])
        law = partial(_stoppable, self._limits.acceleration_m_s2 * _BRAKING, duration_s)
        *linear, opening = between(self._low, self._high, velocity, at, law)
        self._linear, self._opening = np.array(linear), float(opening)
        for volume in self._limits.keep_out:
            self._linear = beside(volume, self._linear, self._tool[:3], law, _ROUNDING_M)


def within(vector: Float64[np.ndarray, "3"], length: float) -> Float64[np.ndarray, "3"]:
    """The vector, shortened to `length` where it is longer."""
    largest = float(np.abs(vector).max())
    # The squares of the largest finite numbers overflow.
    vector = vector if largest <= length else vector * (length / largest)
    norm = float(np.linalg.norm(vector))
    return vector if norm <= length else vector * (length / norm)


def finite(jog: Jog) -> bool:
    """True where every number is finite."""
    return bool(np.isfinite([*jog.linear, *jog.angular, jog.opening]).all())


def still(jog: Jog) -> bool:
    """True for a zero command: nothing moves, turns or opens."""
    return not (jog.linear.any() or jog.angular.any() or jog.opening)


def _stoppable(
    deceleration_m_s2: float, duration_s: float, room_m: Float64[np.ndarray, " A"]
) -> Float64[np.ndarray, " A"]:
    """Largest speeds [m/s] that, held for `duration_s`, leave enough room to stop, for any length of ticks.

    The v with v t + v^2 / 2a = room: a tick later the same formula reduces it by at most `a` times the tick.
    """
    step = deceleration_m_s2 * duration_s
    return np.sqrt(step**2 + 2 * deceleration_m_s2 * np.maximum(room_m, 0.0)) - step
