"""Requested goals: points to the particles that are planned for."""

from typing import Final

import numpy as np

from app.config import Workspace
from app.core.errors import UsageError
from app.core.types import Cloud, Points
from app.perception.body.resample import resample
from app.tasks import load
from app.tasks.elements.feasible import check_goal

_NOISE_M: Final = 0.005
"""Noise of a depth camera on a table 0.6 m away: 2 % of its distance is what RealSense cameras are specified for, and
half of that what is seen."""
_POINT_M: Final = 1e-3
"""Extent below which points are one point, and no object."""


def goal_of(task: str, points: Cloud, particle_count: int, workspace: Workspace, name: str, seed: int = 0) -> Points:
    """`points` (M, 3) [m] as `particle_count` particles, spread evenly through them.

    Points that noise of a depth camera puts a little below the table are put on it. Raises UsageError, which begins
    with `name`, where they are too few, all at one place, leave the workspace, are inside a fixture or where the task
    can bring nothing.
    """
    points = _lifted(points)
    _check_inside(points, workspace, name)
    if float(np.linalg.norm(np.ptp(points, axis=0))) < _POINT_M:
        raise UsageError(f"{name} has all its points at one place; give the points of the whole object.")
    if len(points) < particle_count:
        raise UsageError(
            f"{name} has {len(points)} points; this preset plans with {particle_count} particles and needs at least "
            "as many points."
        )
    particles = points if len(points) == particle_count else resample(points, particle_count, seed=seed)
    check_goal(load(task), particles, name)
    return particles


def _lifted(points: Cloud) -> Cloud:
    """The points with those on the table that lie no more than noise below it."""
    z = points[:, 2]
    return np.column_stack([points[:, :2], np.where((z < 0) & (z >= -_NOISE_M), 0, z)]).astype(points.dtype)


def _check_inside(points: Cloud, workspace: Workspace, name: str) -> None:
    """Raises UsageError, which begins with `name`, where a point leaves the workspace.

    Object points, unlike the tool's, may lie on the table: z starts at 0. NaN is nowhere, and so not inside.
    """
    below = points[:, 2] < -_NOISE_M
    if below.any():
        index = int(np.argmax(below))
        raise UsageError(
            f"{name}: point {index}, {_place(points[index])} m, is below the table, as {int(below.sum())} of "
            f"{len(points)} are, by up to {-1e3 * float(points[:, 2].min()):.1f} mm; give metres in the frame of the "
            "table, whose top is z = 0."
        )
    (x0, y0, _), (x1, y1, z1) = workspace.low, workspace.high
    low, high = np.array([x0, y0, 0], np.float32), np.array([x1, y1, z1], np.float32)
    inside = ((points >= low) & (points <= high)).all(axis=1)
    if not inside.all():
        index = int(np.argmin(inside))
        raise UsageError(
            f"{name}: point {index}, {_place(points[index])} m, is outside the "
            f"workspace x {x0} to {x1}, y {y0} to {y1}, z 0 to {z1} m."
        )


def _place(point: np.ndarray) -> list[float]:
    """Coordinates [m] that are shown as outside where they are, however little."""
    return np.round(point.astype(float), 6).tolist()
