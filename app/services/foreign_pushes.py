"""Pushes in the data of other programs: the object as it was seen before, during and after each motion of the tool."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, NamedTuple, final

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial import KDTree

from app.core.colours import colour_mask
from app.core.errors import PerceptionError, RecordingError
from app.core.geometry.table_place import AT_BASE, TablePlace
from app.core.messages import Frame
from app.core.types import Cloud, Transform
from app.perception.cloud.fuse import Box, merge, without_outliers
from app.perception.reconstruct import Reconstruction, reconstruct
from app.perception.tool_and_table_points import table_points, tool_points
from app.recording.exchange.npz_import import Plain, Poseline, about_in_table, parse_arrays
from app.recording.exchange.streams.measured_episode import MeasuredEpisode, SceneView
from app.recording.exchange.streams.rgbd import DepthUnits, transform_points
from app.recording.exchange.streams.stream_map import StreamMap
from app.services.motion_intervals import Interval, find_motions
from app.tasks.elements.base import Task

_DURING: Final = 5
"""Views of the object during a push."""
_AWAY_M: Final = 0.10
"""Distance of the tool from the object at which a motion has nothing to do with it."""
_FARTHEST_M: Final = 5.0
"""Distance from the base that no tabletop arm reaches."""
_FEWEST: Final = 30
_NEIGHBOURS, _SPREAD = 8, 3.0
_NOTHING: Final[Cloud] = np.zeros((0, 3), np.float32)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ForeignPushes:
    """Pushes in the plain form, and remarks on what was left out."""

    plain: Plain
    notes: tuple[str, ...]


class _Seen(NamedTuple):
    """The object at one moment, and points of tool and table beside it."""

    time_s: float
    phase: str
    cloud: Cloud
    tool: Cloud
    frames: Callable[[], tuple[Frame, ...]] | None


@final
@dataclass(kw_only=True, eq=False)
class _Episode:
    """An episode in the table's frame, and its pushes as seen."""

    measured: MeasuredEpisode
    state: Poseline | None
    command: Poseline
    pushes: list[list[_Seen]] = field(default_factory=list[list[_Seen]])
    table: Cloud = field(default_factory=lambda: _NOTHING)


def find_pushes(
    episodes: Sequence[MeasuredEpisode],
    streams: StreamMap,
    task: Task,
    *,
    place: TablePlace = AT_BASE,
    done: Callable[[float], object] = lambda _: None,
) -> ForeignPushes:
    """All pushes of the episodes, in the frame of the table at `place`; `done` is told the share after each motion.

    Raises RecordingError where there is no motion or no view before and after one, and PerceptionError where no view
    shows the object.
    """
    _require_depth(streams)
    how = _perception(task, streams)
    found, search = list[_Episode](), _Search(how=how, streams=streams, place=place)
    for number, measured in enumerate(episodes):
        found.append(search.episode(measured, lambda share, at=number: done((at + share) / len(episodes))))
    with_pushes = [episode for episode in found if episode.pushes]
    if not with_pushes:
        raise search.search_error()
    about = about_in_table({"task": task.name, **streams.about}, place)
    return ForeignPushes(plain=_plain(with_pushes, about), notes=tuple(search.notes()))


def _require_depth(streams: StreamMap) -> None:
    """Raises RecordingError where one camera alone would have to tell a shape."""
    if streams.cloud is None and len(streams.cameras) == 1 and not streams.cameras[0].depth:
        raise RecordingError(
            f"The one camera {streams.cameras[0].name!r} has no depth, so nothing says how far the object is; name its "
            "depth, or a second camera, in the file of --topics."
        )


def _perception(task: Task, streams: StreamMap) -> Reconstruction:
    """Settings of perception: the task's, and what the mapping says of the object."""
    how, region = replace(task.perception, particle_count=task.preset("cpu").particle_count), streams.object
    box = Box(low=region.low_m or how.box.low, high=region.high_m or how.box.high)
    table_m = how.table_m if region.table_m is None else region.table_m
    return replace(how, colour=region.colour or how.colour, box=box, table_m=table_m)


@final
@dataclass(kw_only=True, eq=False)
class _Search:
    """Search for pushes, and what it left out."""

    how: Reconstruction
    streams: StreamMap
    place: TablePlace
    units: DepthUnits = field(default_factory=DepthUnits)
    motions: int = 0
    without_view: int = 0
    away: int = 0
    unseen: list[PerceptionError] = field(default_factory=list[PerceptionError])

    def episode(self, measured: MeasuredEpisode, done: Callable[[float], object]) -> _Episode:
        """The episode with its pushes."""
        state, command = (self._line_in_table(it) for it in (measured.state, measured.command))
        # A tool that nobody commanded went where it was seen.
        found = _Episode(
            measured=measured,
            state=state if command is not None else None,
            command=command or state or Poseline(times_s=np.zeros(0), poses=np.zeros((0, 7))),
        )
        line = state or found.command
        motions = find_motions(line, measured.moments_s, self.streams.pushes)
        self.motions += len(motions)
        for number, motion in enumerate(motions):
            if (push := self._push(found, line, motion)) is not None:
                found.pushes.append(push)
            done((number + 1) / len(motions))
        return found

    def search_error(self) -> Exception:
        """The error of a search without a push."""
        if self.unseen:
            return self.unseen[0]
        if not self.motions:
            return RecordingError(
                "The tool never moves by a centimetre between two rests, so there is no push; name another tool in the "
                "file of --topics, or the seconds of each push: pushes = [[first, last], ...]."
            )
        if self.without_view:
            return RecordingError(
                f"None of {self.motions} motions has a view of the object before and one after it; give the seconds "
                "of each push in the file of --topics: pushes = [[first, last], ...]."
            )
        return RecordingError(
            f"In none of {self.motions} motions does the tool come within {100 * _AWAY_M:.0f} cm of the object: tool "
            "and object are not in one frame. Check base, tool.frame and the cameras' poses in the file of --topics."
        )

    def notes(self) -> Iterator[str]:
        """Remarks on motions that are no pushes."""
        if self.without_view:
            yield f"{self.without_view} of {self.motions} motions have no view before and after them, and are left out."
        if self.away:
            yield f"{self.away} of {self.motions} motions stay {100 * _AWAY_M:.0f} cm from the object: left out."
        if self.unseen:
            yield f"{len(self.unseen)} of {self.motions} motions are left out. Of the first: {self.unseen[0]}"

    def _push(self, episode: _Episode, line: Poseline, motion: Interval) -> list[_Seen] | None:
        """The object before, during and after the motion; None where it is no push."""
        if motion.before_s is None or motion.after_s is None:
            self.without_view += 1
            return None
        try:
            before = self._look(episode, motion.before_s, "before")
            path = line.between(motion.first_s, motion.last_s).poses[:, :3]
            if not _comes_near(path, before.cloud):
                self.away += 1
                return None
            after = self._look(episode, motion.after_s, "after")
        except PerceptionError as error:
            self.unseen.append(error)
            return None
        return [before, *self._during(episode, line, motion), after]

    def _during(self, episode: _Episode, line: Poseline, motion: Interval) -> Iterator[_Seen]:
        """Views during the motion that show the object: hands hide it."""
        moments = episode.measured.moments_s
        amid = moments[(moments > motion.first_s) & (moments < motion.last_s)]
        chosen = np.unique(np.linspace(0, len(amid) - 1, min(len(amid), _DURING)).round().astype(int))
        for time_s in amid[chosen].tolist() if len(amid) else []:
            at = int(np.argmin(np.abs(line.times_s - time_s)))
            try:
                yield self._look(episode, time_s, "during", line.poses[at, :3])
            except PerceptionError:
                continue

    def _look(self, episode: _Episode, time_s: float, phase: str, tip: Float64[np.ndarray, "3"] | None = None) -> _Seen:
        """The object at a moment. Raises PerceptionError where it is not seen."""

        def look() -> SceneView:
            return _view_in_table(episode.measured.look(time_s), self.place)

        view = look()
        if not view.frames:
            return _Seen(time_s, phase, _object_points(view, self.how), _NOTHING, None)
        for frame in view.frames:
            self.units.add(frame)
        cloud = reconstruct(view.frames, self.how).surface
        if phase == "before" and not len(episode.table):
            episode.table = table_points(view.frames, self.how)
        radius_m = self._finger_radius_m()
        tool = _NOTHING
        if tip is not None and radius_m is not None:
            tool = tool_points(view.frames, tip, self.how, radius_m=radius_m)
        return _Seen(time_s, phase, cloud, tool, lambda: tuple(map(self.units.in_unit, look().frames)))

    def _finger_radius_m(self) -> float | None:
        """Radius of a round finger; None where nobody says it, or of another tool."""
        said = self.streams.about.get("tool", {})
        flat = said.get("shape") == "box" or said.get("half_width_m") or "half_m" in said
        return None if flat or "radius_m" not in said else float(said["radius_m"])

    def _line_in_table(self, line: Poseline | None) -> Poseline | None:
        return None if line is None else Poseline(times_s=line.times_s, poses=self.place.poses_in_table(line.poses))


def _view_in_table(view: SceneView, place: TablePlace) -> SceneView:
    """The view in the table's frame."""
    if place == AT_BASE:
        return view
    T = place.table_from_base
    frames = tuple(_move_frame(frame, T) for frame in view.frames)
    return replace(view, frames=frames, points=transform_points(view.points, T))


def _move_frame(frame: Frame, T: Transform) -> Frame:
    """The frame with its camera in the frame that `T` maps to."""
    return replace(frame, camera=replace(frame.camera, T_world_camera=T @ frame.camera.T_world_camera))


def _object_points(view: SceneView, how: Reconstruction) -> Cloud:
    """Surface of the object in a point cloud: of its colour where points have one, in its box, above the table.

    Raises PerceptionError where too little of it is there, RecordingError where it is out of reach.
    """
    keep: Bool[np.ndarray, " M"] = np.ones(len(view.points), bool)
    if not view.is_object:
        keep = how.box.holds(view.points) & (view.points[:, 2] >= how.table_m + how.table_margin_m)
        if view.colours is not None:
            # A row of three pixels a point: the mask drops what is a single speck in an image.
            row = np.repeat(np.repeat(view.colours[:, None], 3, axis=1)[:, None], 3, axis=1).reshape(-1, 3, 3)
            keep &= colour_mask(np.ascontiguousarray(row), how.colour).reshape(-1, 3, 3)[:, 1, 1]
    kept = view.points[keep]
    far_m = float(np.abs(kept).max(initial=0.0))
    if far_m > _FARTHEST_M:
        raise RecordingError(
            f"A cloud of the object has a point {far_m:.4g} m from the base; give metres, or set cloud.select = true "
            "in the file of --topics, with the box that the object is in."
        )
    if len(kept) < _FEWEST:
        raise PerceptionError(
            f"Of {len(view.points)} points of a cloud {len(kept)} are the object's, {_FEWEST} are needed: they are "
            f"in the box ({how.box}) above the table and have its colour. In the file of --topics set object.low_m, "
            "high_m, table_m and hue_deg, or cloud.select = false where the cloud is the object alone."
        )
    return without_outliers(merge([kept.astype(np.float32)], how.voxel_m), _NEIGHBOURS, _SPREAD)


def _comes_near(path: Float64[np.ndarray, "W 3"], cloud: Cloud) -> bool:
    """True where the path passes the object at less than `_AWAY_M`."""
    return bool(len(path)) and float(KDTree(cloud).query(path)[0].min()) < _AWAY_M


def _plain(episodes: Sequence[_Episode], about: Mapping[str, Any]) -> Plain:
    """The pushes as checked data of the plain format, with their images."""
    plain = parse_arrays(_arrays(episodes, about))
    return replace(
        plain,
        episodes=tuple(
            replace(
                episode,
                pushes=tuple(
                    tuple(replace(sight, frames=seen.frames) for sight, seen in zip(push, pushed, strict=True))
                    for push, pushed in zip(episode.pushes, found.pushes, strict=True)
                ),
            )
            for episode, found in zip(plain.episodes, episodes, strict=True)
        ),
    )


def _arrays(episodes: Sequence[_Episode], about: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Arrays of the plain import format. What was seen once after a push and before the next is there twice."""
    rows = [
        (seen, number, index)
        for number, episode in enumerate(episodes)
        for index, push in enumerate(episode.pushes)
        for seen in push
    ]
    times, last = np.array([seen.time_s for seen, _, _ in rows]), (-1, -np.inf)
    for index, (_, number, _) in enumerate(rows):
        if number == last[0]:
            times[index] = max(times[index], np.nextafter(last[1], np.inf))
        last = number, times[index]
    arrays = {
        **_join("cloud", [seen.cloud for seen, _, _ in rows]),
        **_join("tool", [seen.tool for seen, _, _ in rows]),
        "cloud_time": times,
        "cloud_episode": np.array([number for _, number, _ in rows], np.int32),
        "cloud_push": np.array([index for _, _, index in rows], np.int32),
        "cloud_phase": np.array([seen.phase for seen, _, _ in rows]),
        **_line("command", [episode.command for episode in episodes]),
        "about": np.array(json.dumps(dict(about))),
    }
    if all(episode.state is not None for episode in episodes):
        arrays |= _line("state", [episode.state for episode in episodes if episode.state is not None])
    tables = {number: episode.table for number, episode in enumerate(episodes) if len(episode.table)}
    if tables:
        arrays |= {**_join("table", list(tables.values())), "table_episode": np.array(list(tables), np.int32)}
    return arrays


def _join(name: str, clouds: Sequence[Cloud]) -> dict[str, np.ndarray]:
    ends = np.cumsum([0, *map(len, clouds)]).astype(np.int64)
    return {f"{name}_points": np.concatenate(clouds).astype(np.float32), f"{name}_offsets": ends}


def _line(name: str, lines: Sequence[Poseline]) -> dict[str, np.ndarray]:
    return {
        f"{name}_time": np.concatenate([line.times_s for line in lines]),
        f"{name}_pose": np.concatenate([line.poses for line in lines]),
        f"{name}_episode": np.repeat(np.arange(len(lines)), [len(line.times_s) for line in lines]).astype(np.int32),
    }
