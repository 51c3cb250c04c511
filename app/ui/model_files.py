"""A model of a file that somebody in a browser named: read only where it is one of this program's, and small."""

from pathlib import Path

from app.core.errors import UsageError
from app.core.messages import Model
from app.recording.model_file import load_model

_MOST_BYTES = 1_000_000
"""A model file has some kilobytes."""


def read_model(named: str, folder: Path, *, task: str, time_s: float) -> Model:
    """The model in the file `named`, a path within `folder`, as a message of now.

    Raises UsageError where it is not within the folder, not there, not a TOML file, too large or of another task, and
    RecordingError where it is not a model. Whoever has the page may name files, so no other file is ever opened.
    """
    inside = folder.resolve()
    path = (inside / named.strip()).resolve()
    if not path.is_relative_to(inside) or path.suffix != ".toml":
        raise UsageError(f"{named!r} is not named as a model; give a .toml file within {inside}.")
    if not path.is_file():
        raise UsageError(
            f"There is no file {named!r} within {inside}; `dipac calibrate` and `dipac discover` write one."
        )
    if path.stat().st_size > _MOST_BYTES:
        raise UsageError(f"{named!r} is too large for a model; name the file that `dipac calibrate` wrote.")
    return load_model(path, task=task, time_s=time_s)
