"""Trajectory segments of a path: waypoints with speeds, blended at gentle corners, and fingers in between."""

from dataclasses import dataclass, replace
from typing import final

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.geometry.table_place import AT_BASE, TablePlace
from app.core.types import ToolPath, ToolPose
from app.rig.kinova import gen3
from app.rig.kinova.api.codes import ReferenceFrame
from app.rig.kinova.api.messages import CartesianWaypoint, Pose

BLEND_M = 0.003
"""Largest blending radius: a corner is cut by at most 1 mm, so that the gate's checks hold."""
_GENTLE = np.radians(60.0)
"""Angle above which a corner is not blended: there the arm rests for a moment, as at the end of a descent."""
_SHARE, _MOVED_M, _TURNED, _OPENED_M = 0.4, 1e-4, 1e-3, 1e-3
"""Largest share of a segment's length for a corner; thresholds of motion, rotation and opening."""
_SLOWEST_M_S, _SLOWEST_DEG_S = 0.002, 0.5


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class TrajectorySegment:
    """Trajectory segment: fingers that go to `closed` (0 to 1; None: stay), while the tool follows `ways` to `end`.

    Without waypoints the fingers are waited for.
    """

    closed: float | None
    ways: tuple[CartesianWaypoint, ...]
    end: ToolPose
    duration_s: float


def stretches(
    points: ToolPath, speeds: Float64[np.ndarray, " S"], opening_m: float, angular_rad_s: float
) -> tuple[TrajectorySegment, ...]:
    """Trajectory segments of `points (P, 8)`, each at its speed [m/s], for fingers that open by `opening_m`."""
    found, begin, closed = list[TrajectorySegment](), 0, None
    for index in range(1, len(points)):
        if abs(points[index, 7] - points[index - 1, 7]) <= _OPENED_M:
            continue
        if index - 1 > begin:
            found.append(_stretch(closed, points[begin:index], speeds[begin : index - 1], angular_rad_s))
        begin, closed = index - 1, float(np.clip(1.0 - points[index, 7] / opening_m, 0.0, 1.0))
        alone = _stretch(closed, points[index - 1 : index + 1], speeds[index - 1 : index], angular_rad_s)
        if not alone.ways:
            found.append(alone)
            begin, closed = index, None
    if len(points) - 1 > begin:
        found.append(_stretch(closed, points[begin:], speeds[begin:], angular_rad_s))
    return tuple(found)


def in_base(stretch: TrajectorySegment, table: TablePlace) -> TrajectorySegment:
    """The segment with its waypoints in the frame of the arm's base; `end` stays in the table's, like measurements."""
    if table == AT_BASE:
        return stretch
    return replace(stretch, ways=tuple(_way_in_base(way, table) for way in stretch.ways))


def _way_in_base(way: CartesianWaypoint, table: TablePlace) -> CartesianWaypoint:
    return replace(way, pose=gen3.pose(table.base_from_table @ gen3.transform(way.pose or Pose())))


def _stretch(
    closed: float | None, points: ToolPath, speeds: Float64[np.ndarray, " S"], angular_rad_s: float
) -> TrajectorySegment:
    legs = [
        _leg(before, after, float(speed), angular_rad_s)
        for before, after, speed in zip(points, points[1:], speeds, strict=False)
    ]
    kept = [index for index, (moves, _, _) in enumerate(legs) if moves]
    corners = _radii(points[[0, *(index + 1 for index in kept)], :3]) if kept else []
    return TrajectorySegment(
        closed=closed,
        ways=tuple(
            _waypoint(points[index + 1], legs[index][1], radius) for index, radius in zip(kept, corners, strict=True)
        ),
        end=points[-1],
        duration_s=sum((legs[index][2] for index in kept), 0.0),
    )


def _leg(
    before: ToolPose, after: ToolPose, speed: float, angular_rad_s: float
) -> tuple[bool, tuple[float, float], float]:
    """Motion flag, speeds [m/s, degrees/s] and duration [s] of a segment; False where nothing moves or turns.

    The speed holds for the tip and, at a lever of 0.1 m, for rotation (`app/arm/path.py`): both take equally long.
    """
    lever_m = 0.1
    way = float(np.linalg.norm(after[:3] - before[:3]))
    turn = float((_rotation(before).inv() * _rotation(after)).magnitude())
    lasts_s = max(np.hypot(way, lever_m * turn) / speed, turn / angular_rad_s, 1e-3)
    linear = way / lasts_s if way > _MOVED_M else speed
    angular = np.degrees(turn / lasts_s if turn > _TURNED else angular_rad_s)
    limits = (
        float(np.clip(linear, _SLOWEST_M_S, gen3.LINEAR_M_S)),
        float(np.clip(angular, _SLOWEST_DEG_S, gen3.ANGULAR_DEG_S)),
    )
    return way > _MOVED_M or turn > _TURNED, limits, lasts_s


def _radii(points: Float64[np.ndarray, "K 3"]) -> list[float]:
    """Blending radius of the corner at each point after the first; zero for the last."""
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    radii = list[float]()
    for before, after, here, then in zip(steps, steps[1:], lengths, lengths[1:], strict=False):
        cosine = float(before @ after / max(here * then, 1e-12))
        gentle = min(here, then) > _MOVED_M and np.arccos(np.clip(cosine, -1.0, 1.0)) < _GENTLE
        radii.append(float(min(BLEND_M, _SHARE * min(here, then))) if gentle else 0.0)
    return [*radii, 0.0]


def _waypoint(pose: ToolPose, limits: tuple[float, float], radius_m: float) -> CartesianWaypoint:
    x, y, z = (float(each) for each in pose[:3])
    turn = [float(each) for each in _rotation(pose).as_euler("xyz", degrees=True)]
    return CartesianWaypoint(
        pose=Pose(x=x, y=y, z=z, theta_x=turn[0], theta_y=turn[1], theta_z=turn[2]),
        reference_frame=ReferenceFrame.BASE,
        maximum_linear_velocity=limits[0],
        maximum_angular_velocity=limits[1],
        blending_radius=radius_m,
    )


def _rotation(pose: ToolPose) -> Rotation:
    return Rotation.from_quat(pose[3:7], scalar_first=True)
