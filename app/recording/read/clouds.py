"""The clouds of a recording for other programs: as PLY files, or as arrays in the plain import format."""

import itertools
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float32, Float64

from app.core.errors import RecordingError
from app.core.messages import Episode, Executed, MessageId, Particles, Sighting, Transition
from app.core.types import Cloud
from app.recording.read.reader import read_messages

What: TypeAlias = Literal["particles", "surface"]
"""The object filled with particles, or the points of it that cameras saw."""


def write_ply(path: Path, folder: Path, what: What) -> int:
    """Write each cloud of the recording as a binary PLY file in `folder`, named by seconds since the first.

    Returns the number of clouds. Raises RecordingError where there is none or it cannot be written; and as
    `read_messages`.
    """
    import trimesh  # Loaded where it is needed alone: it takes its time.

    count, first_s = 0, float("nan")
    for particles in _clouds(path):
        if count == 0:
            folder.mkdir(parents=True)
            first_s = particles.time_s
        cloud = particles.positions if what == "particles" else particles.surface
        name = f"{count:05d}-{particles.time_s - first_s:08.3f}s.ply"
        trimesh.PointCloud(cloud).export(str(folder / name))
        count += 1
    if count == 0:
        raise RecordingError(f"{path} holds no cloud; nothing was written.")
    return count


def write_npz(path: Path, file: Path) -> int:
    """Write the pushes of the recording, with the clouds before and after each, in the format of `dipac import`.

    The clouds are surfaces. Returns the number of pushes. Raises RecordingError where there is none; and as
    `read_messages`.
    """
    pushes, tools, task = _pushes(path)
    if not pushes:
        raise RecordingError(f"{path} holds no push with the object seen before and after it; nothing was written.")
    sights = [(particles, index, phase) for index, push in enumerate(pushes) for particles, phase in push.sights]
    times, episodes = zip(*((particles.time_s, pushes[index].episode) for particles, index, _ in sights), strict=True)
    arrays = {
        **_join("cloud", [particles.surface for particles, _, _ in sights]),
        "cloud_time": _apart(np.array(times), np.array(episodes)),
        "cloud_episode": np.array(episodes, np.int32),
        "cloud_push": np.array([index for _, index, _ in sights], np.int32),
        "cloud_phase": np.array([phase for _, _, phase in sights]),
        **_track("command", pushes, [push.executed.commanded for push in pushes]),
        "about": np.array(json.dumps({"task": task})),
    }
    if all(len(push.executed.measured) for push in pushes):
        arrays |= _track("state", pushes, [push.executed.measured for push in pushes])
    if tools:
        nothing = np.zeros((0, 3), np.float32)
        arrays |= _join("tool", [tools.get(particles.time_s, nothing) for particles, _, _ in sights])
    np.savez_compressed(file, allow_pickle=False, **arrays)
    return len(pushes)


class _Push(NamedTuple):
    """A motion, the observations before and after it, and the index of its episode."""

    episode: int
    executed: Executed
    sights: Sequence[tuple[Particles, str]]


def _clouds(path: Path) -> Iterator[Particles]:
    return (message for message in read_messages(path, [Particles]) if isinstance(message, Particles))


def _pushes(path: Path) -> tuple[list[_Push], dict[float, Cloud], str]:
    """Every push, the tool's points by the time of their observation, and the task."""
    seen = dict[MessageId, Particles]()
    pushes, tools, episodes = list[_Push](), dict[float, Cloud](), list[Episode]()
    for message in read_messages(path, [Episode, Particles, Sighting, Transition]):
        match message:
            case Episode():
                episodes.append(message)
            case Particles():
                seen[message.id] = message
            case Sighting():
                tools[message.time_s] = message.tool
            case Transition(cause=(before, _, after)) if before in seen and after in seen:
                sights = [(seen[before], "before"), (seen[after], "after")]
                pushes.append(_Push(max(len(episodes) - 1, 0), message.executed, sights))
            case _:
                pass
    return pushes, tools, episodes[0].task if episodes else ""


def _join(name: str, clouds: Sequence[Float32[np.ndarray, "_ 3"]]) -> dict[str, np.ndarray]:
    """Concatenated clouds, and the offsets of each."""
    ends = np.cumsum([0, *map(len, clouds)]).astype(np.int64)
    return {f"{name}_points": np.concatenate(clouds), f"{name}_offsets": ends}


def _track(name: str, pushes: Sequence[_Push], poses: Sequence[Float64[np.ndarray, "_ 7"]]) -> dict[str, np.ndarray]:
    lengths = [len(push.executed.times_s) for push in pushes]
    return {
        f"{name}_time": np.concatenate([push.executed.times_s for push in pushes]),
        f"{name}_pose": np.concatenate(poses),
        f"{name}_episode": np.repeat([push.episode for push in pushes], lengths).astype(np.int32),
    }


def _apart(times_s: np.ndarray, episodes: np.ndarray) -> np.ndarray:
    """The times made strictly increasing: an observation after one push may be the one before the next."""
    apart = times_s.copy()
    for before, after in itertools.pairwise(range(len(apart))):
        if episodes[before] == episodes[after]:
            apart[after] = max(apart[after], np.nextafter(apart[before], np.inf))
    return apart
