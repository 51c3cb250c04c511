"""What depends on the site, not on the task: workspace, limits, timing, places on disk.

All numbers are SI; the ranges are read by the command line and the console, and checked by `app.core.bounds`.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, final

import numpy as np

from app.core.table_place import AT_BASE, TablePlace

_STILL_M = 1e-12
"""A line that is shorter than this along an axis does not move along that."""


@final
@dataclass(frozen=True, kw_only=True)
class Workspace:
    """The box in which the tool tip may be [m, world frame]; the table top is z = 0."""

    low: tuple[float, float, float] = (0.25, -0.35, 0.005)
    high: tuple[float, float, float] = (0.85, 0.35, 0.45)

    def contains(self, positions: np.ndarray) -> bool:
        """Whether every position `(..., 3)` lies in the box."""
        return bool(np.all(positions >= np.asarray(self.low)) and np.all(positions <= np.asarray(self.high)))


@final
@dataclass(frozen=True, kw_only=True)
class KeepOut:
    """A box that the tool tip may not enter [m, world frame]: a camera's stand, a shelf, a person's place."""

    name: str
    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def entered(self, path: np.ndarray) -> bool:
        """Whether the straight lines between `path (W, 3)` enter the box, touching not included.

        By slabs (Kay and Kajiya, Ray tracing complex scenes, 1986): a line is inside from the last of the three faces
        that it enters to the first that it leaves.
        """
        start, step = (path, np.zeros_like(path)) if len(path) == 1 else (path[:-1], np.diff(path, axis=0))
        low, high = np.asarray(self.low), np.asarray(self.high)
        still = np.abs(step) < _STILL_M
        over = np.where(still, 1.0, step)
        first, second = (low - start) / over, (high - start) / over
        within = (start > low) & (start < high)
        enters = np.where(still, np.where(within, -np.inf, np.inf), np.minimum(first, second))
        leaves = np.where(still, np.where(within, np.inf, -np.inf), np.maximum(first, second))
        return bool(np.any(np.maximum(enters.max(1), 0.0) < np.minimum(leaves.min(1), 1.0)))


@final
@dataclass(frozen=True, kw_only=True)
class Reach:
    """How far an arm reaches: its wrist is up to `radius_m` from its shoulder, which is at `middle` [m, world frame].

    The wrist is `hand_m` behind the tool's tip, along the axis that the tool points along.
    """

    middle: tuple[float, float, float]
    radius_m: float
    hand_m: float

    def beyond_m(self, poses: np.ndarray) -> np.ndarray:
        """How far out of reach the wrist is at each of `poses (..., 7 or more)`, below zero within: shape (...)."""
        w, x, y, z = np.moveaxis(poses[..., 3:7], -1, 0)
        axis = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=-1)
        wrist = poses[..., :3] - self.hand_m * axis
        return np.asarray(np.linalg.norm(wrist - np.asarray(self.middle), axis=-1) - self.radius_m)


@final
@dataclass(frozen=True, kw_only=True)
class Confines:
    """Where in its workspace an arm may not or cannot be; a planner is compiled for them."""

    keep_out: tuple[KeepOut, ...] = ()
    reach: Reach | None = None


ANYWHERE: Final = Confines()


@final
@dataclass(frozen=True, kw_only=True)
class Limits:
    """What the arm may do; checked by the planner and again in the arm's own process."""

    speed_m_s: float = 0.30
    acceleration_m_s2: float = 1.5
    stop_deceleration_m_s2: float = 6.0
    angular_speed_rad_s: float = 1.0
    """Of a tool that is moved by hand; in a motion the speed of its tip holds for turning, too."""
    angular_acceleration_rad_s2: float = 5.0
    opening_m: float = 0.085
    """The stroke of the two-finger gripper (Robotiq 2F-85)."""
    force_n: float = 60.0
    """Of the tool against what it meets, where the arm measures that: beyond it the arm stops."""
    gripper_ma: float | None = None
    """Of current of the gripper's motor, where the arm measures that: beyond it the fingers close no further."""
    workspace: Workspace = field(default_factory=Workspace)
    keep_out: tuple[KeepOut, ...] = ()
    reach: Reach | None = None
    """Of an arm that does not reach all of its workspace."""

    @property
    def confines(self) -> Confines:
        """What a planner is compiled for."""
        return Confines(keep_out=self.keep_out, reach=self.reach)

    def trespassed(self, path: np.ndarray) -> KeepOut | None:
        """The first volume that the straight lines between `path (W, 3)` [m] enter, None where they enter none."""
        return next((volume for volume in self.keep_out if volume.entered(path)), None)


@final
@dataclass(frozen=True, kw_only=True)
class Timing:
    """Periods and deadlines [s]."""

    arm_period_s: float = 0.010
    watchdog_s: float = 0.160
    """Of silence, after which the arm's process stops it: with 50 ms to brake from full speed, two ticks and the
    drives' own lag it is at rest within 250 ms of whatever silenced the application (bench/faults)."""
    keepalive_s: float = 0.020
    camera_period_s: float = 0.5
    camera_timeout_s: float = 5.0
    settle_s: float = 0.6
    plan_max_age_s: float = 300.0
    plan_max_drift_m: float = 0.008
    object_unseen_s: float = 5.0
    health_period_s: float = 0.5
    jog_rest_s: float = 0.7
    """A tool moved by hand that has been at rest for so long is at the end of a stretch."""
    jog_longest_s: float = 60.0
    """A longer stretch is ended: the arm's log of states holds about 80 s."""


@final
@dataclass(frozen=True, kw_only=True)
class Site:
    """One installation of the program."""

    limits: Limits = field(default_factory=Limits)
    table: TablePlace = AT_BASE
    """The table in the frame of a real arm's base; all else here is in the table's."""
    timing: Timing = field(default_factory=Timing)
    travel_height_m: float = 0.12
    recordings: Path = Path("recordings")
    min_free_bytes: int = 2_000_000_000
    budget_bytes: int | None = None
    """Of recordings in their folder, at most."""
    recording_bytes_s: float = 1.5e6
    """Of two cameras that look twice a second, with all else: 43 MB in 32 s (docs/recording-format.md)."""
    console_host: str = "127.0.0.1"
    console_port: int = 8088
