"""The goal that `--goal` names: points in a file."""

from pathlib import Path

from app.core.errors import UsageError
from app.core.types import Cloud
from app.recording.exchange.points_file import ADVICE, points_in


def read_goal(path: Path) -> Cloud:
    """The points (M, 3) [m] of an .npy, .npz or .ply file. Raises UsageError where the file holds none."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UsageError(f"Cannot read the goal {path}: {error.strerror}; {ADVICE}.") from None
    return points_in(f"the goal {path}", data)
