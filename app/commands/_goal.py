"""The goal that `--goal` names: points in an .npy file."""

from pathlib import Path

import numpy as np

from app.core.errors import UsageError
from app.core.types import Cloud


def read_goal(path: Path) -> Cloud:
    """The points (M, 3) [m] of an .npy file. Raises UsageError where the file is no such array."""
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
