"""Recordings as a study for discovery: each transition a push, with observations before, during and after it."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, final

import msgspec
import numpy as np

from app.core.errors import RecordingError, UsageError
from app.core.geometry.object_description import ObjectDescription, recorded_object
from app.core.geometry.track import Track
from app.core.measured_setup import KEY, MeasuredSetup
from app.core.messages import Episode, Executed, Message, MessageId, Particles, Sighting, Transition
from app.core.task_name import recorded_name
from app.core.types import OPENING, Cloud, Points, Poses
from app.discovery.dataset.model_under_test import Subject
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.jobs.discovery_subject import subject_of
from app.perception.body.resample_to_count import resample_bodies
from app.recording.library.recording_index import counted_once
from app.recording.read.reader import read_cameras, read_messages
from app.services.sightings import look_beside
from app.tasks import load
from app.tasks.elements.base import Task
from app.tasks.elements.descriptions import with_appearance

_BETWEEN_S = 10.0
"""Gap from the end of an episode to the start of one whose clock began anew."""


def read_study(
    paths: Sequence[Path], *, task: str | None = None, description: ObjectDescription | None = None
) -> Study:
    """All pushes of all recordings, in the order of the files; an episode begins with each `Episode` in them.

    Views have as many points as the task's CPU preset has particles. `task` None takes that of the recordings. Where an
    episode's clock runs behind the one before, it is moved to after it. The cameras' middle is that of the first
    recording that has images. Where a recording has images and does not say what they show of tool and table, as those
    of `dipac run`, both are looked for in them, which takes a few seconds a minute of recording.

    A demonstration or a clip is left out where its session is among them. `description`: the object; None takes the one
    that the first recording describes, if it describes any.

    Raises UsageError where recordings are of different tasks, of another than `task`, or there are none;
    RecordingError where they hold no push, a cloud of too few points, or no openings of a tool that opens, and as
    `read_messages`.
    """
    if not paths:
        raise UsageError("Name at least one recording: dipac discover recordings/FILE.mcap")
    paths = counted_once(paths)
    episodes = [episode for path in paths for episode in _episodes(path)]
    name = _task_of(episodes, task)
    description = description or _object_of(episodes)
    known = with_appearance(load(name), description)
    setup, priors = _setup_of(episodes), () if description is None else description.priors
    subject, pushes, tables = subject_of(known, setup), list[Push](), dict[int, Cloud]()
    for path in dict.fromkeys(paths):
        _look(path, [episode for episode in episodes if episode.path == path], known, subject)
    now_s = -np.inf
    for number, episode in enumerate(episode for episode in episodes if episode.transitions):
        found = [_push(number, transition, episode, subject) for transition in episode.transitions]
        first_s = found[0].before.time_s
        late_s = now_s + _BETWEEN_S - first_s if first_s < now_s else 0.0
        found = [_later(push, late_s) for push in found]
        now_s = max(found[-1].after.time_s, float(found[-1].command.times_s[-1]))
        pushes += found
        bare = next((sighting.table for sighting in episode.sightings.values() if len(sighting.table)), None)
        if bare is not None:
            tables[number] = bare
    if not pushes:
        raise RecordingError(f"{_list(paths)}: no finished push to learn from; record some with `dipac run {name}`.")
    study = Study(task=name, pushes=tuple(pushes), tables=tables, setup=setup, priors=priors)
    if setup is not None and setup.camera_m is not None:
        return replace(study, camera=setup.camera_m)
    camera = _camera(paths)
    return study if camera is None else replace(study, camera=camera)


def _object_of(episodes: Sequence["_Recorded"]) -> ObjectDescription | None:
    """The object that the first recording with a description describes."""
    found = (recorded_object(each.episode.config) for each in episodes)
    return next((each for each in found if each is not None), None)


def _import(config: str) -> dict[str, Any]:
    """Notes that an import made, an object of JSON; of what else began an episode, nothing."""
    try:
        found: Any = json.loads(config)
    except json.JSONDecodeError:
        return {}
    return found if isinstance(found, dict) else {}


def _setup_of(episodes: Sequence["_Recorded"]) -> MeasuredSetup | None:
    """Setup of imported recordings: the first's, with the flaws of all."""
    setups = list[MeasuredSetup]()
    for episode in episodes:
        config = _import(episode.episode.config)
        if KEY in config:
            setups.append(msgspec.convert(config[KEY], MeasuredSetup))
    if not setups:
        return None
    every = tuple(dict.fromkeys(flaw for setup in setups for flaw in setup.flaws))
    table = next((setup.table for setup in setups if setup.table.taken_out), setups[0].table)
    return replace(setups[0], flaws=every, table=table)


@final
@dataclass(kw_only=True, eq=False)
class _Recorded:
    """Contents of a recording for one episode, as far as it has been read."""

    path: Path
    episode: Episode
    particles: list[Particles] = field(default_factory=list[Particles])
    sightings: dict[float, Sighting] = field(default_factory=dict[float, Sighting])
    transitions: list[Transition] = field(default_factory=list[Transition])

    def add(self, message: Message) -> None:
        match message:
            case Particles():
                # Surfaces are by far the largest part of a recording, and are not needed.
                self.particles.append(replace(message, surface=message.surface[:0]))
            case Sighting():
                self.sightings[message.time_s] = message
            case Transition():
                self.transitions.append(message)
            case _:
                pass


def _episodes(path: Path) -> list[_Recorded]:
    episodes = list[_Recorded]()
    for message in read_messages(path, [Episode, Particles, Sighting, Transition]):
        if isinstance(message, Episode):
            episodes.append(_Recorded(path=path, episode=message))
        elif episodes:
            episodes[-1].add(message)
    return episodes


def _look(path: Path, episodes: Sequence[_Recorded], task: Task, subject: Subject) -> None:
    """Add the sightings that a recording lacks: of the tool in views during pushes, of the table in the first view.

    A frame is behind one view at most.
    """
    tools, tables = dict[MessageId, tuple[Particles, np.ndarray]](), dict[MessageId, Particles]()
    blind = [episode for episode in episodes if episode.transitions and not episode.sightings]
    for episode in blind:
        first = next((seen for seen in episode.particles if seen.cause), None)
        tables |= {first.id: first} if first is not None else {}
        for transition in episode.transitions:
            made = _track(path, transition.executed, transition.executed.made, subject)
            for seen in _during(episode, transition.executed, subject.low_m):
                tools[seen.id] = (seen, made.poses_at(np.array([seen.time_s]))[0])
    found = look_beside(path, tools, tables, task) if read_cameras(path) else {}
    for episode in blind:
        times = {seen.time_s for seen in episode.particles}
        episode.sightings.update({time_s: sighting for time_s, sighting in found.items() if time_s in times})


def _task_of(episodes: Sequence[_Recorded], wanted: str | None) -> str:
    tasks = {each.path: recorded_name(each.episode.task) for each in episodes}
    names = {recorded_name(each.episode.task) for each in episodes}
    listed = ", ".join(f"{path}: {task}" for path, task in tasks.items())
    if len(names) > 1:
        raise UsageError(
            f"The recordings are of different tasks ({listed}); give those of one task at a time. Imported ones of "
            "one object have the same sizes where about, or --task of `dipac import`, says them."
        )
    if wanted is not None and names - {wanted}:
        raise UsageError(f"--task {wanted} contradicts the recordings ({listed}); leave --task out, or give others.")
    if not names:
        raise RecordingError("The recordings name no episode; they were cut off before their first message.")
    return names.pop()


def _push(number: int, transition: Transition, episode: _Recorded, subject: Subject) -> Push:
    executed = transition.executed
    before, after = transition.before, transition.after

    def view(time_s: float, points: Points) -> ProjectionView:
        sighting = episode.sightings.get(time_s)
        finger = sighting.tool if sighting is not None and len(sighting.tool) else None
        return ProjectionView(time_s=time_s, points=_resample(points, subject, episode.path), finger=finger)

    return Push(
        episode=number,
        before=view(_observed_at_s(before, transition.cause, episode, float(executed.times_s[0])), before),
        during=tuple(view(seen.time_s, seen.positions) for seen in _during(episode, executed, subject.low_m)),
        after=view(_observed_at_s(after, transition.cause, episode, float(executed.times_s[-1])), after),
        command=_track(episode.path, executed, executed.commanded, subject),
        measured=_track(episode.path, executed, executed.measured, subject) if len(executed.measured) else None,
    )


def _track(path: Path, executed: Executed, poses: Poses, subject: Subject) -> Track:
    """The tool's track, with the opening of a tool that opens.

    Openings are as measured, of a command as well: recordings have no others. Raises RecordingError where they have
    none of a tool that opens.
    """
    if subject.tool_coordinates > OPENING:
        if len(executed.openings) != len(poses):
            raise RecordingError(
                f"{path}: how far the gripper is open is not recorded, so when it held the object is unknown; give "
                "recordings of `dipac run` or `dipac hide`."
            )
        poses = np.concatenate([poses, executed.openings[:, None]], axis=1)
    return Track(times_s=executed.times_s, poses=poses)


def _during(episode: _Recorded, executed: Executed, low_m: float) -> list[Particles]:
    """Observations while the tool could touch the object."""
    low = executed.times_s[executed.made[:, 2] < low_m]
    return [seen for seen in episode.particles if len(low) and low[0] < seen.time_s < low[-1]]


def _observed_at_s(points: Points, cause: tuple[MessageId, ...], episode: _Recorded, otherwise_s: float) -> float:
    """Time of the observation that a transition was made of; the motion's own time if that is not known."""
    same = [seen for seen in episode.particles if np.array_equal(seen.positions, points)]
    named = [seen for seen in same if seen.id in cause]
    # An object that did not move may look the same before and after.
    times = (seen.time_s for seen in named or same)
    return min(times, key=lambda time_s: abs(time_s - otherwise_s), default=otherwise_s)


def _resample(cloud: Cloud, subject: Subject, path: Path) -> Points:
    try:
        return resample_bodies(cloud, subject.particle_count, subject.scene.split)
    except ValueError as error:
        raise RecordingError(f"{path}: a cloud cannot be compared with the simulation: {error}") from None


def _later(push: Push, by_s: float) -> Push:
    """The same push by a clock that is set back by so much."""

    def view(at: ProjectionView) -> ProjectionView:
        return replace(at, time_s=at.time_s + by_s)

    def track(at: Track) -> Track:
        return replace(at, times_s=at.times_s + by_s)

    if by_s == 0:
        return push
    return replace(
        push,
        before=view(push.before),
        during=tuple(map(view, push.during)),
        after=view(push.after),
        command=track(push.command),
        measured=None if push.measured is None else track(push.measured),
    )


def _camera(paths: Sequence[Path]) -> tuple[float, float, float] | None:
    """The middle of the cameras of the first recording that has any [m]."""
    for path in paths:
        places = [camera.T_world_camera[:3, 3] for camera in read_cameras(path)]
        if places:
            x, y, z = np.mean(places, axis=0).tolist()
            return x, y, z
    return None


def _list(paths: Sequence[Path]) -> str:
    return ", ".join(map(str, paths))
