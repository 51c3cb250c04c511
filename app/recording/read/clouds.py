"""The clouds of a recording for other programs: as PLY files, or as arrays in the plain import format."""

import itertools
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias, final

import numpy as np
from jaxtyping import Float32, Float64

from app.core.errors import RecordingError
from app.core.measured_setup import KEY
from app.core.messages import Episode, Executed, Particles, Sighting, Transition
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
        cloud = _cloud(particles, what)
        name = f"{count:05d}-{particles.time_s - first_s:08.3f}s.ply"
        trimesh.PointCloud(cloud).export(str(folder / name))
        count += 1
    if count == 0:
        raise RecordingError(f"{path} holds no cloud; nothing was written.")
    return count


def write_npz(path: Path, file: Path, what: What = "surface") -> int:
    """Write the pushes of the recording in the format of `dipac import`, with all clouds from before to after each.

    The clouds are `what` of it; of imported data they are as they were given. Returns the number of pushes. Raises
    RecordingError where there is none; and as `read_messages`.
    """
    recorded = _Recorded.read(path)
    pushes, tools = recorded.pushes, recorded.tools
    if not pushes:
        raise RecordingError(f"{path} holds no push with the object seen before and after it; nothing was written.")
    sights = [(particles, index, phase) for index, push in enumerate(pushes) for particles, phase in push.sights]
    times, episodes = zip(*((particles.time_s, pushes[index].episode) for particles, index, _ in sights), strict=True)
    arrays = {
        **_join("cloud", [_cloud(particles, what if recorded.made_here else "surface") for particles, _, _ in sights]),
        "cloud_time": _apart(np.array(times), np.array(episodes)),
        "cloud_episode": np.array(episodes, np.int32),
        "cloud_push": np.array([index for _, index, _ in sights], np.int32),
        "cloud_phase": np.array([phase for _, _, phase in sights]),
        **_track("command", pushes, [push.executed.commanded for push in pushes]),
        "about": np.array(json.dumps(recorded.about)),
    }
    if all(len(push.executed.measured) for push in pushes):
        arrays |= _track("state", pushes, [push.executed.measured for push in pushes])
    if any(len(tool) for tool in tools.values()):
        arrays |= _join("tool", [tools.get(particles.time_s, _NOTHING) for particles, _, _ in sights])
    if recorded.tables:
        arrays |= _join("table", list(recorded.tables.values()))
        arrays["table_episode"] = np.array(list(recorded.tables), np.int32)
    np.savez_compressed(file, allow_pickle=False, **arrays)
    return len(pushes)


_NOTHING = np.zeros((0, 3), np.float32)


class _Push(NamedTuple):
    """A motion, the observations from before to after it, and the index of its episode."""

    episode: int
    executed: Executed
    sights: Sequence[tuple[Particles, str]]


def _cloud(particles: Particles, what: What) -> Cloud:
    return particles.positions if what == "particles" else particles.surface


def _clouds(path: Path) -> Iterator[Particles]:
    return (message for message in read_messages(path, [Particles]) if isinstance(message, Particles))


@final
@dataclass(kw_only=True, eq=False)
class _Recorded:
    """Content of a recording in the plain format.

    `tools`: the tool's points by the time of their observation; `tables`: the bare table's by the index of the episode;
    `about`: what is known of task, tool and object; `made_here`: whether nothing of it was imported.
    """

    pushes: list[_Push] = field(default_factory=list)
    tools: dict[float, Cloud] = field(default_factory=dict)
    tables: dict[int, Cloud] = field(default_factory=dict)
    about: dict[str, Any] = field(default_factory=dict)
    made_here: bool = True

    @classmethod
    def read(cls, path: Path) -> "_Recorded":
        found, seen, episode = cls(), list[Particles](), -1
        for message in read_messages(path, [Episode, Particles, Sighting, Transition]):
            match message:
                case Episode():
                    episode += 1
                    found.about = found.about or _about(message)
                    found.made_here &= message.rig != "imported"
                case Particles():
                    seen.append(message)
                case Sighting():
                    found.tools[message.time_s] = message.tool
                    if len(message.table):
                        found.tables.setdefault(max(episode, 0), message.table)
                case Transition():
                    if sights := _sights(seen, message):
                        found.pushes.append(_Push(max(episode, 0), message.executed, sights))
                        # The object after this push may be the one before the next.
                        seen = seen[seen.index(sights[-1][0]) :]
                case _:
                    pass
        with_pushes = {push.episode for push in found.pushes}
        found.tables = {number: table for number, table in found.tables.items() if number in with_pushes}
        return found


def _sights(seen: Sequence[Particles], transition: Transition) -> list[tuple[Particles, str]]:
    """Observations from before to after a motion, and their phases; none where its begin or end was not seen."""
    before, _, after = transition.cause
    ids = [particles.id for particles in seen]
    if before not in ids or after not in ids:
        return []
    first, last = ids.index(before), ids.index(after)
    moving = transition.executed.times_s
    during = [it for it in seen[first + 1 : last] if moving[0] < it.time_s < moving[-1]]
    return [(seen[first], "before"), *((it, "during") for it in during), (seen[last], "after")]


def _about(episode: Episode) -> dict[str, Any]:
    """Known properties of task, tool and object: of imported data as they said it."""
    said = json.loads(episode.config) if episode.rig == "imported" else {}
    return {**{key: value for key, value in said.items() if key != KEY}, "task": episode.task}


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
