"""A timed way of the tool as a motion of the arm, and the timed way that an arm makes of a motion."""

from typing import Final

import numpy as np

from app.arm.gate import way
from app.arm.path import SCALE, PathFollower
from app.config import Site
from app.core.errors import PlanningError
from app.core.geometry.track import Track
from app.core.motion import Motion
from app.core.types import ToolPath, ToolPose

_PERIOD_S: Final = 0.06
"""Time from one position to the next: the lines between them leave the way of a tool that speeds up to 0.4 m/s and
down again within 0.1 m, or turns about a point 0.1 m away, by less than two millimetres."""
_STILL_M: Final = 1e-5
_REST_S: Final = 0.1
"""A rest on the way that is shorter is left out."""
_NOD_M: Final = 1e-3
_APPROACH_M_S: Final = 0.1
"""Speed to the first pose, which may be millimetres from where the arm has been told to be."""
_SLOWEST_M_S: Final = 1e-4
_TICK_S: Final = 0.01


def motion_along(track: Track, site: Site) -> Motion:
    """Motion that goes on from the first pose of `track` along it, as fast as it, but no faster than the site allows.

    An arm rests nowhere on its way: where the track does, the tool rises by a millimetre and comes down again in that
    time. Rests at both ends are left out. Raises PlanningError where the track stands still.
    """
    span_s = track.end_s - float(track.times_s[0])
    count = max(1, int(np.ceil(span_s / _PERIOD_S)))
    poses = _with_openings(track.poses_at(np.linspace(track.times_s[0], track.end_s, count + 1)))
    steps, step_s = np.linalg.norm(np.diff(poses * SCALE, axis=0), axis=1), span_s / count
    moving = np.flatnonzero(steps > _STILL_M)
    if not len(moving):
        raise PlanningError("The tool stands still all the way, which is no motion.")
    way, speeds, rested_s = [poses[0]], [_APPROACH_M_S], 0.0
    for index in range(moving[0], moving[-1] + 1):
        if steps[index] <= _STILL_M:
            rested_s += step_s
            continue
        if rested_s >= _REST_S:
            raised = poses[index] + np.array([0.0, 0.0, _NOD_M, *[0.0] * 5])
            way += [raised, poses[index]]
            speeds += [2 * _NOD_M / rested_s] * 2
        rested_s = 0.0
        way.append(poses[index + 1])
        speeds.append(steps[index] / step_s)
    made = np.array(way)
    return Motion(
        positions=made[:, :3],
        speeds=np.clip(speeds, _SLOWEST_M_S, site.limits.speed_m_s),
        turns=made[:, 3:7],
        openings=made[:, 7],
        continues=True,
    )


def made_track(tool: ToolPose, motion: Motion, site: Site) -> Track:
    """Timed poses (T, 8) of an arm that makes the motion from the pose of the `tool`, without errors.

    Raises MotionRefused where the approach is not allowed.
    """
    points, speeds = way(tool, motion, site)
    follower, made = PathFollower(points, speeds, site.limits.acceleration_m_s2), [points[0]]
    while not follower.at_rest:
        made.append(follower.advance(_TICK_S))
    return Track(times_s=_TICK_S * np.arange(len(made)), poses=np.array(made))


def _with_openings(poses: np.ndarray) -> ToolPath:
    """The poses with openings, of which a tool that does not open has none."""
    return np.concatenate([poses, np.zeros((len(poses), 8 - poses.shape[1]))], axis=1)
