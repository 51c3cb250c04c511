"""Requested goals: points to the particles that are planned for."""

import numpy as np

from app.config import Workspace
from app.core.errors import UsageError
from app.core.types import Cloud, Points
from app.perception.body.resample import resample
from app.tasks import load
from app.tasks.elements.feasible import check_goal


def goal_of(task: str, points: Cloud, particle_count: int, workspace: Workspace, name: str, seed: int = 0) -> Points:
    """`points` (M, 3) [m] as `particle_count` particles, spread evenly through them.

    Raises UsageError, which begins with `name`, where they are too few, leave the workspace, are inside a fixture or
    where the task can bring nothing.
    """
    _check_inside(points, workspace, name)
    if len(points) < particle_count:
        raise UsageError(
            f"{name} has {len(points)} points; this preset plans with {particle_count} particles and needs at least "
            "as many points."
        )
    particles = points if len(points) == particle_count else resample(points, particle_count, seed=seed)
    check_goal(load(task), particles, name)
    return particles


def _check_inside(points: Cloud, workspace: Workspace, name: str) -> None:
    """Raises UsageError, which begins with `name`, where a point leaves the workspace.

    Object points, unlike the tool's, may lie on the table: z starts at 0. NaN is nowhere, and so not inside.
    """
    (x0, y0, _), (x1, y1, z1) = workspace.low, workspace.high
    low, high = np.array([x0, y0, 0], np.float32), np.array([x1, y1, z1], np.float32)
    inside = ((points >= low) & (points <= high)).all(axis=1)
    if not inside.all():
        index = int(np.argmin(inside))
        raise UsageError(
            f"{name}: point {index}, {np.round(points[index].astype(float), 3).tolist()} m, is outside the "
            f"workspace x {x0} to {x1}, y {y0} to {y1}, z 0 to {z1} m."
        )
