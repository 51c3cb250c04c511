"""Suggested pushes, as a file: `dipac probe --recordings` writes it, probe and console make them."""

from pathlib import Path
from typing import TYPE_CHECKING, Final

from app.core.errors import RecordingError, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from app.config import Site
    from app.core.geometry.track import Track
    from app.core.motion import Motion
    from app.discovery.experiments.probe_pushes import Probe

PUSHES: Final = "pushes.json"


def write_pushes(path: Path, task: str, probes: "Sequence[Probe]") -> None:
    """The pushes in the order in which to make them. Raises UsageError where the file cannot be written."""
    import msgspec

    from app.report.schema import PushEntry, PushesFile
    from app.report.verdict_json import track_entry

    pushes = tuple(
        PushEntry(text=probe.text, between=probe.between, nats=probe.nats, track=track_entry(probe.track))
        for probe in probes
    )
    try:
        path.write_bytes(msgspec.json.format(msgspec.json.encode(PushesFile(task=task, pushes=pushes)), indent=1))
    except OSError as error:
        raise UsageError(f"Cannot write {path}: {error.strerror}; choose another folder with -o.") from None


def read_pushes(path: Path, task: str) -> "tuple[Track, ...]":
    """The ways of the tool in a file of pushes for `task`.

    Raises UsageError where it cannot be read or is for another task, RecordingError where it is no such file.
    """
    import msgspec
    import numpy as np

    from app.core.geometry.track import Track
    from app.report.schema import PushesFile

    try:
        file = msgspec.json.decode(path.read_bytes(), type=PushesFile)
    except OSError as error:
        raise UsageError(f"Cannot read {path}: {error.strerror}; `dipac probe --recordings` writes one.") from None
    except msgspec.DecodeError as error:
        raise RecordingError(f"{path} holds no pushes ({error}); run `dipac probe --recordings` again.") from None
    if file.task != task:
        raise UsageError(f"{path} is for task {file.task!r}, not {task!r}; name that task.")
    tracks = list["Track"]()
    for number, push in enumerate(file.pushes, 1):
        times, poses = np.array(push.track.times_s, float), np.zeros((0, 7))
        if all(len(pose) == poses.shape[1] for pose in push.track.poses):
            poses = np.array(push.track.poses, float).reshape(-1, 7)
        if len(times) != len(poses) or not np.isfinite(poses).all() or not (np.diff(times) > 0).all() or not len(times):
            raise RecordingError(f"{path}: push {number} is no way of a tool; run `dipac probe --recordings` again.")
        tracks.append(Track(times_s=times, poses=poses))
    return tuple(tracks)


def motions_in(path: Path, task: str, name: str, site: "Site") -> "tuple[Motion, ...]":
    """The same as motions of the arm; `name` is the full one of `task`. To be run where the simulator may be loaded."""
    from app.jobs.probed import probe_motion
    from app.tasks import load

    return tuple(probe_motion(load(name), track, site) for track in read_pushes(path, task))
