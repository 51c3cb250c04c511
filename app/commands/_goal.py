"""The goal that `--goal` names: points in an .npy file."""

from pathlib import Path

import numpy as np

from app.config import Workspace
from app.core.errors import UsageError
from app.core.types import Cloud, Points
from app.perception.resample import resample


def read_goal(path: Path, workspace: Workspace, *, particle_count: int, seed: int) -> Points:
    """The points (M, 3) [m] of an .npy file as `particle_count` particles, spread evenly through them.

    Raises UsageError where the file is no such array, has fewer points or leaves the workspace.
    """
    points = _read(path)
    _check_inside(points, path, workspace)
    if len(points) < particle_count:
        raise UsageError(
            f"The goal {path} has {len(points)} points; this preset plans with {particle_count} particles and needs "
            "at least as many points."
        )
    return points if len(points) == particle_count else resample(points, particle_count, seed=seed)


def _read(path: Path) -> Cloud:
    try:
        with path.open("rb") as stream:
            points = np.lib.format.read_array(stream, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise UsageError(f"Cannot read the goal {path}: {why}; give an .npy file of points (M, 3) in metres.") from None
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "fiu":
        raise UsageError(
            f"The goal {path} has shape {points.shape} of {points.dtype}; it must be points (M, 3) in metres."
        )
    return points.astype(np.float32)


def _check_inside(points: Cloud, path: Path, workspace: Workspace) -> None:
    """Object points, unlike the tool's, may lie on the table: z starts at 0. NaN is nowhere, and so not inside."""
    (x0, y0, _), (x1, y1, z1) = workspace.low, workspace.high
    low, high = np.array([x0, y0, 0], np.float32), np.array([x1, y1, z1], np.float32)
    inside = ((points >= low) & (points <= high)).all(axis=1)
    if not inside.all():
        index = int(np.argmin(inside))
        raise UsageError(
            f"Goal point {index} of {path}, {np.round(points[index].astype(float), 3).tolist()} m, is outside the "
            f"workspace x {x0} to {x1}, y {y0} to {y1}, z 0 to {z1} m."
        )
