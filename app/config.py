"""Configuration of a site, independent of the task: workspace, limits, timing, places on disk.

All numbers are SI; the ranges are read by the command line and the console, and checked by `app.core.bounds`.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, final

import numpy as np

from app.core.geometry.table_place import AT_BASE, TablePlace

_STILL_M = 1e-12
"""Length along an axis below which a line does not move along it."""


@final
@dataclass(frozen=True, kw_only=True)
class Workspace:
    """The box in which the tool tip may be [m, world frame]; the table top is z = 0."""

    low: tuple[float, float, float] = (0.25, -0.35, 0.005)
    high: tuple[float, float, float] = (0.85, 0.35, 0.45)

    def contains(self, positions: np.ndarray) -> bool:
        """True where every position `(..., 3)` lies in the box."""
        return bool(np.all(positions >= np.asarray(self.low)) and np.all(positions <= np.asarray(self.high)))


@final
@dataclass(frozen=True, kw_only=True)
class KeepOut:
    """A box that the tool tip may not enter [m, world frame]: a camera's stand, a shelf, a person's place."""

    name: str
    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def is_entered_by(self, path: np.ndarray) -> bool:
        """True where the straight lines between `path (W, 3)` enter the box, touching not included.

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
    """Reach of an arm: its wrist is up to `radius_m` from its shoulder, which is at `middle` [m, world frame].

    The wrist is `hand_m` behind the tool's tip, along the tool's axis.
    """

    middle: tuple[float, float, float]
    radius_m: float
    hand_m: float

    def beyond_m(self, poses: np.ndarray) -> np.ndarray:
        """Distance of the wrist out of reach at each of `poses (..., 7 or more)`, negative within; shape (...)."""
        w, x, y, z = np.moveaxis(poses[..., 3:7], -1, 0)
        axis = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=-1)
        wrist = poses[..., :3] - self.hand_m * axis
        return np.asarray(np.linalg.norm(wrist - np.asarray(self.middle), axis=-1) - self.radius_m)


@final
@dataclass(frozen=True, kw_only=True)
class Confines:
    """Constraints of an arm within its workspace; a planner is compiled for them."""

    keep_out: tuple[KeepOut, ...] = ()
    reach: Reach | None = None


ANYWHERE: Final = Confines()


@final
@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits of the arm; checked by the planner and again in the arm's own process."""

    speed_m_s: float = 0.30
    acceleration_m_s2: float = 1.5
    stop_deceleration_m_s2: float = 6.0
    angular_speed_rad_s: float = 1.0
    """Angular speed of a jogged tool; in a motion the speed of its tip limits rotation, too."""
    angular_acceleration_rad_s2: float = 5.0
    opening_m: float = 0.085
    """Stroke of the two-finger gripper (Robotiq 2F-85)."""
    force_n: float = 60.0
    """Contact force of the tool, where the arm measures it: beyond it the arm stops."""
    gripper_ma: float | None = None
    """Current of the gripper's motor, where the arm measures it: beyond it the fingers close no further."""
    workspace: Workspace = field(default_factory=Workspace)
    keep_out: tuple[KeepOut, ...] = ()
    reach: Reach | None = None
    """Reach of an arm that does not reach all of its workspace."""

    @property
    def confines(self) -> Confines:
        """Constraints for the planner."""
        return Confines(keep_out=self.keep_out, reach=self.reach)

    def entered_volume(self, path: np.ndarray) -> KeepOut | None:
        """The first volume that the straight lines between `path (W, 3)` [m] enter, None where they enter none."""
        return next((volume for volume in self.keep_out if volume.is_entered_by(path)), None)


@final
@dataclass(frozen=True, kw_only=True)
class Timing:
    """Periods and deadlines [s]."""

    arm_period_s: float = 0.010
    watchdog_s: float = 0.160
    """Silence of the application after which the arm's process stops the arm: with 50 ms to brake from full speed,
    two ticks and the drives' own lag it is at rest within 250 ms of any cause of the silence (bench/faults)."""
    keepalive_s: float = 0.020
    camera_period_s: float = 0.5
    camera_timeout_s: float = 5.0
    settle_s: float = 0.6
    plan_max_age_s: float = 300.0
    plan_max_drift_m: float = 0.008
    object_unseen_s: float = 5.0
    health_period_s: float = 0.5
    jog_rest_s: float = 0.7
    """Rest of a jogged tool that ends a jog."""
    jog_longest_s: float = 60.0
    """Longest jog: the arm's log of states holds about 80 s."""


@final
@dataclass(frozen=True, kw_only=True)
class Site:
    """One installation of the program."""

    limits: Limits = field(default_factory=Limits)
    table: TablePlace = AT_BASE
    """Pose of the table in the frame of a real arm's base; everything else here is in the table's frame."""
    timing: Timing = field(default_factory=Timing)
    travel_height_m: float = 0.12
    recordings: Path = Path("recordings")
    min_free_bytes: int = 2_000_000_000
    budget_bytes: int | None = None
    """Size limit of all recordings in their folder."""
    recording_bytes_s: float = 1.5e6
    """Data rate of a whole recording with two cameras at two frames a second: 43 MB in 32 s
    (docs/recording-format.md)."""
    console_host: str = "127.0.0.1"
    console_port: int = 8088
