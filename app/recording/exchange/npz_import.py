"""The plain import format: arrays in one .npz file, for data measured with other programs.

docs/recording-format.md describes each array. Everything read is checked first, so that bad input is not mistaken for a
strange result: an error names the array and the first bad index.
"""

import itertools
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from math import pi, radians, remainder
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Literal, TypeAlias, cast, final

import numpy as np
from jaxtyping import Float32, Float64, Int64
from scipy.spatial.transform import Rotation

from app.core.errors import RecordingError, UsageError
from app.core.geometry.camera import CameraModel
from app.core.geometry.table_place import TablePlace
from app.core.messages import Frame
from app.core.system.array_file import read_arrays
from app.core.types import Cloud, Poses
from app.recording.exchange.plain_checks import (
    as_array,
    finite,
    forward,
    offsets,
    plausible_about,
    plausible_cloud,
    plausible_poses,
    whole_pushes,
)

Places: TypeAlias = Float64[np.ndarray, "*batch 3"]
Phase: TypeAlias = Literal["before", "during", "after"]
PHASES: Final[tuple[Phase, ...]] = ("before", "during", "after")

_REQUIRED: Final = (
    *("cloud_points", "cloud_offsets", "cloud_time", "cloud_episode", "cloud_push", "cloud_phase"),
    *("command_time", "command_pose", "command_episode", "about"),
)
_TOGETHER: Final = (
    ("state_time", "state_pose", "state_episode"),
    ("tool_points", "tool_offsets"),
    ("table_points", "table_offsets", "table_episode"),
)
"""Optional arrays, to be given together row by row."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class PlainObservation:
    """One moment: the object, and the finger's points in the same images (maybe none).

    `frames` reads those images again, where they are at hand.
    """

    time_s: float
    phase: Phase
    cloud: Cloud
    tool: Float32[np.ndarray, "L 3"]
    frames: Callable[[], tuple[Frame, ...]] | None = None


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Poseline:
    """Poses of the tool's tip at times: x y z [m], quaternion w x y z."""

    times_s: Float64[np.ndarray, " T"]
    poses: Poses

    def between(self, first_s: float, last_s: float) -> "Poseline":
        """The poses from one time to the other."""
        own = (self.times_s >= first_s) & (self.times_s <= last_s)
        return Poseline(times_s=self.times_s[own], poses=self.poses[own])


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class PlainEpisode:
    """One episode: each push as its observations before, during and after it; tracks; points of the bare table."""

    number: int
    pushes: tuple[tuple[PlainObservation, ...], ...]
    command: Poseline
    state: Poseline | None
    table: Cloud


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Plain:
    """A whole file. `about`: known properties of task, tool and object."""

    about: Mapping[str, Any]
    episodes: tuple[PlainEpisode, ...]

    def in_table(self, place: TablePlace) -> "Plain":
        """The content moved from the frame of the arm's base to that of a table at `place`."""
        moved = self.mapped(place.points_in_table, place.poses_in_table)
        return replace(moved, about=about_in_table(self.about, place))

    def mapped(self, points: Callable[[Places], Places], poses: Callable[[Poses], Poses]) -> "Plain":
        """The content with positions [m] and poses mapped to another frame; `about` is unchanged."""

        def cloud(given: Cloud) -> Cloud:
            return points(given.astype(np.float64)).astype(np.float32)

        def line(given: Poseline) -> Poseline:
            return Poseline(times_s=given.times_s, poses=poses(given.poses))

        def sight(given: PlainObservation) -> PlainObservation:
            frames = None if given.frames is None else partial(_move_frames, given.frames, poses)
            return replace(given, cloud=cloud(given.cloud), tool=cloud(given.tool), frames=frames)

        def episode(given: PlainEpisode) -> PlainEpisode:
            return replace(
                given,
                pushes=tuple(tuple(map(sight, push)) for push in given.pushes),
                command=line(given.command),
                state=None if given.state is None else line(given.state),
                table=cloud(given.table),
            )

        return replace(self, episodes=tuple(map(episode, self.episodes)))


def _move_frames(read: Callable[[], tuple[Frame, ...]], poses: Callable[[Poses], Poses]) -> tuple[Frame, ...]:
    """Frames whose cameras are mapped to another frame as poses are."""
    return tuple(replace(frame, camera=_move_camera(frame.camera, poses)) for frame in read())


def _move_camera(camera: CameraModel, poses: Callable[[Poses], Poses]) -> CameraModel:
    turn = Rotation.from_matrix(camera.T_world_camera[:3, :3]).as_quat(scalar_first=True)
    moved = poses(np.concatenate([camera.T_world_camera[:3, 3], turn])[None])[0]
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(moved[3:], scalar_first=True).as_matrix()
    T[:3, 3] = moved[:3]
    return replace(camera, T_world_camera=T)


def about_in_table(about: Mapping[str, Any], place: TablePlace) -> Mapping[str, Any]:
    """The known properties, with a flat finger's yaw converted from the base's x axis to the table's."""
    tool = about.get("tool", {})
    if "yaw_rad" not in tool:
        return about
    yaw = remainder(tool["yaw_rad"] - radians(place.turn_deg), 2 * pi)
    return {**about, "tool": {**tool, "yaw_rad": yaw}}


def read_plain(path: Path) -> Plain:
    """The file's content, checked.

    Raises UsageError where there is no such file or an array has an unknown name, and RecordingError, which names the
    array and the first bad index, where a value is impossible.
    """
    arrays = _load(path)
    try:
        return parse_arrays(arrays)
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from None


def _load(path: Path) -> dict[str, np.ndarray]:
    if not path.is_file():
        raise UsageError.unknown("file", str(path), map(str, path.parent.glob("*.npz")))
    known = {*_REQUIRED, *(name for names in _TOGETHER for name in names)}
    try:
        arrays = read_arrays(path)
    except (OSError, ValueError) as error:
        raise RecordingError(
            f"{path} is no .npz file of plain arrays ({error}); docs/recording-format.md has a script that makes one."
        ) from None
    for name in arrays:
        if name not in known:
            raise UsageError.unknown("array", name, known)
    return arrays


def parse_arrays(arrays: Mapping[str, np.ndarray]) -> Plain:
    """The arrays of the format, checked. Raises RecordingError, which names the array and the first bad index."""
    missing = [name for name in _REQUIRED if name not in arrays]
    for names in _TOGETHER:
        if any(name in arrays for name in names):
            missing += [name for name in names if name not in arrays]
    if missing:
        raise RecordingError(f"the array {missing[0]} is missing; docs/recording-format.md lists what is needed.")
    about = _about(arrays["about"])
    command, state = _tracks(arrays, "command"), _tracks(arrays, "state") if "state_time" in arrays else {}
    clouds = _clouds(arrays, "cloud", None)
    count = len(clouds)
    tools = _clouds(arrays, "tool", count) if "tool_points" in arrays else [_NOTHING] * count
    plausible_cloud(clouds, about)
    times = finite("cloud_time", as_array("cloud_time", arrays, (count,), np.float64))
    episode, push = (as_array(name, arrays, (count,), np.int64) for name in ("cloud_episode", "cloud_push"))
    forward("cloud_time", times, "cloud_episode", episode)
    phases = _phases(arrays["cloud_phase"], count)
    groups = whole_pushes(times, episode, push, phases, {number: line.times_s for number, line in command.items()})
    tables = _tables(arrays)
    for number in tables:
        if number not in groups:
            raise RecordingError(f"table_episode has episode {number}, of which there is no cloud.")
    return Plain(
        about=MappingProxyType(about),
        episodes=tuple(
            PlainEpisode(
                number=number,
                pushes=tuple(
                    tuple(
                        PlainObservation(time_s=float(times[k]), phase=phases[k], cloud=clouds[k], tool=tools[k])
                        for k in members
                    )
                    for members in pushes
                ),
                command=command[number],
                state=state.get(number),
                table=tables.get(number, _NOTHING),
            )
            for number, pushes in groups.items()
        ),
    )


_NOTHING: Cloud = np.zeros((0, 3), np.float32)


def _about(array: np.ndarray) -> dict[str, Any]:
    if array.shape != () or array.dtype.kind != "U":
        raise RecordingError(f"about must be one string, and is {array.dtype} of the shape {array.shape}.")
    try:
        about = json.loads(str(array))
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"about is no JSON that can be read ({error}).") from None
    if not isinstance(about, dict):
        raise RecordingError('about must be a JSON object, for example {"task": "rope_push"}.')
    plausible_about(cast(dict[str, Any], about))
    return cast(dict[str, Any], about)


def _clouds(arrays: Mapping[str, np.ndarray], kind: str, count: int | None) -> list[Float32[np.ndarray, "_ 3"]]:
    """The points of `kind` split at their offsets, into `count` clouds where that is given."""
    points = finite(f"{kind}_points", as_array(f"{kind}_points", arrays, (None, 3), np.float32))
    ends = offsets(f"{kind}_offsets", arrays, len(points), count)
    return [points[first:last] for first, last in itertools.pairwise(ends)]


def _tables(arrays: Mapping[str, np.ndarray]) -> dict[int, Cloud]:
    if "table_points" not in arrays:
        return {}
    episodes: Int64[np.ndarray, " L"] = as_array("table_episode", arrays, (None,), np.int64)
    clouds = _clouds(arrays, "table", len(episodes))
    numbers = episodes.tolist()
    for index, number in enumerate(numbers):
        if number in numbers[:index]:
            raise RecordingError(f"table_episode[{index}] names episode {number} again; one cloud an episode is read.")
    return dict(zip(numbers, clouds, strict=True))


def _tracks(arrays: Mapping[str, np.ndarray], kind: str) -> dict[int, Poseline]:
    """Tracks of one kind, by episode."""
    times: Float64[np.ndarray, " T"] = finite(f"{kind}_time", as_array(f"{kind}_time", arrays, (None,), np.float64))
    poses = finite(f"{kind}_pose", as_array(f"{kind}_pose", arrays, (len(times), 7), np.float64))
    episode = as_array(f"{kind}_episode", arrays, (len(times),), np.int64)
    forward(f"{kind}_time", times, f"{kind}_episode", episode)
    plausible_poses(f"{kind}_pose", times, poses, episode)
    return {
        int(number): Poseline(times_s=times[episode == number], poses=poses[episode == number])
        for number in np.unique(episode)
    }


def _phases(array: np.ndarray, count: int) -> list[Phase]:
    if array.shape != (count,) or array.dtype.kind not in "US":
        raise RecordingError(f"cloud_phase must be {count} strings, and is {array.dtype} of the shape {array.shape}.")
    phases = [value.decode("ascii", "replace") if isinstance(value, bytes) else str(value) for value in array.tolist()]
    for index, phase in enumerate(phases):
        if phase not in PHASES:
            raise RecordingError(f"cloud_phase[{index}] is {phase!r}; known are {', '.join(PHASES)}.")
    return cast(list[Phase], phases)
