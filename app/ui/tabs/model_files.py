"""Model files named by a browser: read only where they are models of this program, and small."""

from pathlib import Path

from app.core.errors import UsageError
from app.core.messages import Model
from app.recording.exchange.model_file import load_model

_MOST_BYTES = 1_000_000
"""Size limit; a model file has some kilobytes."""


def read_model(named: str, folder: Path, *, task: str, time_s: float) -> Model:
    """The model in the file `named`, a path within `folder`, as a message dated `time_s`.

    Raises UsageError where it is not within the folder, missing, not a TOML file, too large or of another task, and
    RecordingError where it is not a model. Any user of the page may name files, so no other file is ever opened.
    """
    inside = folder.resolve()
    path = _find_file(inside, named.strip())
    if path is None:
        raise UsageError(f"{named!r} is no model of this folder; give a .toml file within {inside}.")
    if path.stat().st_size > _MOST_BYTES:
        raise UsageError(f"{named!r} is too large for a model; name the file that `dipac calibrate` wrote.")
    return load_model(path, task=task, time_s=time_s, whole=False)


def _find_file(folder: Path, named: str) -> Path | None:
    """The plain .toml file of that name within the folder, with links resolved."""
    try:
        path = (folder / named).resolve()
        return path if path.is_relative_to(folder) and path.suffix == ".toml" and path.is_file() else None
    except (OSError, ValueError, RuntimeError):  # A name that no file can have, or links in a circle.
        return None
