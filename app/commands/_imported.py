"""Plain measured data as the messages of a recording."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import msgspec
import numpy as np

from app import __version__
from app.core.errors import RecordingError
from app.core.geometry.track import poses_at
from app.core.measured_setup import KEY, MeasuredSetup
from app.core.messages import Episode, Executed, Message, MessageId, Particles, Sighting, Transition, fresh_id
from app.perception.body.resample_to_count import resample_bodies
from app.recording.exchange.npz_import import Plain, PlainEpisode, PlainObservation
from app.tasks.elements.base import Task

NOBODY: Final = MessageId("imported")
"""Stands for the approval that imported motions did not have."""


def imported_messages(plain: Plain, task: Task, setup: MeasuredSetup | None = None) -> Iterator[Message]:
    """All of it, in the order in which it happened, each object as many particles as the CPU preset has.

    A cloud stands in its `Particles` as the surface, as it was given. `setup`: what is simulated, and who says so.
    """
    config = dict(plain.about) if setup is None else {**plain.about, KEY: msgspec.to_builtins(setup)}
    for episode in plain.episodes:
        first = episode.pushes[0][0]
        yield Episode(
            id=fresh_id("episode"),
            time_s=first.time_s,
            task=task.recorded_name,
            rig="imported",
            seed=0,
            simulated=False,
            code_version=__version__,
            config=json.dumps(config),
        )
        for number, sights in enumerate(episode.pushes):
            seen = list[Particles]()
            for sight in sights:
                frames = sight.frames() if sight.frames else ()
                yield from frames
                particles = _particles(sight, task, tuple(frame.id for frame in frames))
                seen.append(particles)
                yield particles
                table = episode.table if number == 0 and sight is first else episode.table[:0]
                if len(sight.tool) or len(table):
                    yield Sighting(
                        id=fresh_id("sighting"),
                        time_s=sight.time_s,
                        tool=sight.tool,
                        table=table,
                        cause=particles.cause,
                    )
            yield from _motion_messages(episode, seen)


def _particles(sight: PlainObservation, task: Task, frames: tuple[MessageId, ...]) -> Particles:
    try:
        positions = resample_bodies(sight.cloud, task.preset("cpu").particle_count, task.scene.split)
    except ValueError as error:
        raise RecordingError(f"A cloud of {task.name} at {sight.time_s:g} s: {error}") from None
    return Particles(
        id=fresh_id("particles"),
        cause=frames,
        time_s=sight.time_s,
        positions=positions,
        surface=sight.cloud,
        reconstruction_s=0.0,
    )


def _motion_messages(episode: PlainEpisode, seen: Sequence[Particles]) -> Iterator[Message]:
    """The motion between the first and the last observation, and its outcome."""
    before, after = seen[0], seen[-1]
    command = episode.command.between(before.time_s, after.time_s)
    state = episode.state.between(before.time_s, after.time_s) if episode.state else None
    times = command.times_s if state is None else np.union1d(command.times_s, state.times_s)
    measured = np.zeros((0, 7))
    if state is not None and len(state.times_s):
        measured = poses_at(times, state.times_s, state.poses)
    executed = Executed(
        id=fresh_id("executed"),
        cause=(before.id,),
        time_s=float(times[-1]),
        approved_id=NOBODY,
        outcome="completed",
        reason="imported",
        times_s=times,
        commanded=poses_at(times, command.times_s, command.poses),
        measured=measured,
    )
    yield executed
    yield Transition.between(before, executed, after)


def plain_lines(path: Path, plain: Plain) -> Iterator[str]:
    """Content of a file of arrays in words."""
    pushes = [push for episode in plain.episodes for push in episode.pushes]
    sights = [sight for push in pushes for sight in push]
    points = [len(sight.cloud) for sight in sights]
    yield f"{path}: {len(pushes)} pushes in {len(plain.episodes)} episodes, {len(sights)} clouds of the object."
    yield f"Points of a cloud: {min(points)} to {max(points)}."
    optional = {
        "poses of the tool as measured": any(episode.state is not None for episode in plain.episodes),
        "points of the tool": any(len(sight.tool) for sight in sights),
        "points of the bare table": any(len(episode.table) for episode in plain.episodes),
        "views during pushes": any(sight.phase == "during" for sight in sights),
    }
    for there, text in ((True, "Besides: "), (False, "Not there: ")):
        names = [name for name, has in optional.items() if has == there]
        if names:
            yield f"{text}{', '.join(names)}."
    yield f"About: {json.dumps(dict(plain.about))}"
