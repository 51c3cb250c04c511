"""Motion validation in the arm's own process before anything moves, independent of earlier checks. Pure.

Each rule has a code (`core/rejection_codes.py`); the rules are applied in the order of this file.
"""

from typing import Final

import numpy as np
from jaxtyping import Float64

from app.arm.control import Control
from app.arm.path import at_travel_height, route
from app.config import Limits, Site
from app.core.errors import MotionRefused
from app.core.motion import Motion
from app.core.rejection_codes import Refusal
from app.core.types import ToolPath, ToolPose

MAX_WAYPOINTS: Final = 1024
_ROUNDING: Final = 1e-9
_JOINED_M: Final = 0.005
"""Largest distance from the tool to the start of a motion that continues."""
_UNIT: Final = 1e-6
"""Tolerance of a quaternion's length."""


def begin(control: Control, motion: Motion, digest: str, site: Site) -> None:
    """Have `control` execute `motion`. Raises MotionRefused, with nothing moved, where it is not allowed."""
    if control.mode != "idle":
        code = Refusal.BUSY if control.mode == "moving" else Refusal.STOPPED
        raise MotionRefused(code, f"The arm is {control.mode}; wait for its end, or reset it after a stop.")
    check_motion(motion, digest, site)
    control.begin(*way(control.commanded, motion, site))


def way(tool: ToolPose, motion: Motion, site: Site) -> tuple[ToolPath, Float64[np.ndarray, " S"]]:
    """The whole path of a checked motion from the pose of the `tool`, and its speeds: see `route`.

    Raises MotionRefused where the approach is not allowed.
    """
    away_m = float(np.linalg.norm(motion.positions[0] - tool[:3]))
    if motion.continues and away_m > _JOINED_M:
        raise MotionRefused(
            Refusal.ELSEWHERE,
            f"The motion continues from where the tool was, and the tool is {1e3 * away_m:.0f} mm away; plan again.",
        )
    points, speeds = route(tool, motion, site)
    if not site.limits.workspace.contains(points[:, :3]):
        raise MotionRefused(
            Refusal.OUTSIDE, "The way to the motion leaves the workspace; lower the travel height, or move the tool in."
        )
    _check_free(points[:, :3], site.limits, "The way to the motion")
    _check_reach(points, site.limits, "The way to the motion")
    return points, speeds


def refusal(motion: Motion, site: Site, tool: ToolPose | None = None) -> str:
    """Why the arm's own process would not make the motion, in its words; empty where it would.

    It begins at the pose of the `tool`; where that is unknown, above its first position, or there if it continues.
    """
    first = np.asarray(motion.poses[0])
    above = first if motion.continues else at_travel_height(first, site)
    try:
        check_motion(motion, motion.digest(), site)
        way(above if tool is None else tool, motion, site)
    except MotionRefused as refused:
        return str(refused)
    return ""


def check_motion(motion: Motion, digest: str, site: Site) -> None:
    """Raise MotionRefused with the reason where `motion` is not the approved one, or outside the limits of `site`."""
    if motion.digest() != digest:
        raise MotionRefused(
            Refusal.NOT_APPROVED,
            "The motion is not the one that was approved (its digest differs); plan and approve again.",
        )
    _check_shape(motion)
    _check_place(motion, site.limits)
    _check_tool(motion, site.limits)
    speeds, fastest = motion.speeds, site.limits.speed_m_s
    if np.any(speeds <= 0) or np.any(speeds > fastest * (1 + _ROUNDING)):
        raise MotionRefused(
            Refusal.SPEED, f"Speeds must be above 0 and up to {fastest} m/s; the fastest is {np.max(speeds):.3f}."
        )
    _check_reach(motion.poses, site.limits, "The motion")


def _check_shape(motion: Motion) -> None:
    """Raise MotionRefused where the arrays do not make a motion."""
    count = len(motion.positions)
    if count > MAX_WAYPOINTS:
        raise MotionRefused(Refusal.SHAPE, f"A motion has up to {MAX_WAYPOINTS} positions; thin this one out.")
    if count == 0 or count != len(motion.speeds):
        raise MotionRefused(
            Refusal.SHAPE, f"A motion needs a speed for each position; it has {count} and {len(motion.speeds)}."
        )
    for name, told in (("turns", motion.turns), ("openings", motion.openings)):
        if len(told) not in (0, count):
            raise MotionRefused(
                Refusal.SHAPE, f"A motion needs as many {name} as positions, or none; it has {len(told)}."
            )
    if not all(np.isfinite(told).all() for told in (motion.poses, motion.speeds)):
        raise MotionRefused(Refusal.NOT_FINITE, "The motion holds numbers that are not finite; plan again.")


def _check_place(motion: Motion, limits: Limits) -> None:
    """Raise MotionRefused where the motion leaves the workspace or enters a keep-out volume."""
    if not limits.workspace.contains(motion.positions):
        box = limits.workspace
        raise MotionRefused(
            Refusal.OUTSIDE, f"The motion leaves the workspace {box.low} to {box.high} m; plan inside it."
        )
    _check_free(motion.positions, limits, "The motion")


def _check_free(path: np.ndarray, limits: Limits, name: str) -> None:
    """Raise MotionRefused where `path (W, 3)` enters a keep-out volume."""
    volume = limits.entered_volume(path)
    if volume is not None:
        raise MotionRefused(Refusal.KEEP_OUT, f"{name} enters {volume.name!r}, which is kept free; plan around it.")


def _check_reach(poses: ToolPath, limits: Limits, name: str) -> None:
    """Raise MotionRefused where one of `poses` is out of the arm's reach.

    Between two poses of equal orientation the wrist stays within reach: it goes straight, in a ball. A tool that turns
    on the way may swing its wrist out of it, which the arm's own controller detects.
    """
    if limits.reach is not None and (beyond_m := float(limits.reach.beyond_m(poses).max())) > 0:
        raise MotionRefused(
            Refusal.REACH,
            f"{name} goes {np.ceil(1e3 * beyond_m):.0f} mm further than the arm reaches; plan nearer to its base.",
        )


def _check_tool(motion: Motion, limits: Limits) -> None:
    """Raise MotionRefused where a quaternion or an opening is not possible for the tool."""
    if not (np.abs(np.linalg.norm(motion.turns, axis=1) - 1) < _UNIT).all():
        raise MotionRefused(
            Refusal.TOOL, "The motion turns the tool by quaternions that are not of unit length; plan again."
        )
    if not ((motion.openings >= 0) & (motion.openings <= limits.opening_m)).all():
        raise MotionRefused(
            Refusal.TOOL, f"The motion opens the tool beyond 0 to {limits.opening_m} m; plan inside that."
        )
