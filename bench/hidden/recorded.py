"""A study as recordings, one file an episode, in the common format: nothing in them reveals their origin.

`dipac hide` writes those of MuJoCo's world the same way: a clock that begins at a fixed time, numbered ids, no seed.
"""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from app import __version__
from app.core.geometry.camera import CameraModel
from app.core.messages import Episode, Executed, Frame, Message, MessageId, Particles, Sighting, Transition
from app.core.types import Cloud
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.recording.format.clock_offset import Epoch
from app.recording.write.file import EpisodeFile

_START_S = 1000.0
_NOBODY = MessageId("rehearsed")
_NOTHING = np.zeros((0, 3), np.float32)
_POSE = 7
"""Numbers of a pose, after which a track may have the opening."""


def write(study: Study, folder: Path) -> list[Path]:
    """The recordings of a study in a new folder, in their order."""
    folder.mkdir(parents=True)
    paths = list[Path]()
    for number in sorted({push.episode for push in study.pushes}):
        path = folder / f"episode-{number + 1:02d}.mcap"
        messages = _messages(study, number)
        first = next(messages)
        assert isinstance(first, Episode)
        file = EpisodeFile(path, first, epoch=Epoch(offset_ns=0))
        file.write(first, now_s=first.time_s)
        for message in messages:
            file.write(message, now_s=message.time_s)
        file.close()
        paths.append(path)
    return paths


def _messages(study: Study, episode: int) -> Iterator[Message]:
    numbered = [(number, push) for number, push in enumerate(study.pushes) if push.episode == episode]
    yield Episode(
        id=MessageId(f"episode-{episode:06d}"),
        time_s=_START_S + numbered[0][1].before.time_s,
        task=study.task,
        rig="simulated",
        seed=0,
        simulated=True,
        code_version=__version__,
        config=json.dumps({"preset": "cpu", "pushes": len(numbered)}),
    )
    yield _frame(study.camera, numbered[0][1].before.time_s, episode)
    for place, (number, push) in enumerate(numbered):
        yield from _pushed(push, number, study.tables.get(episode, _NOTHING) if place == 0 else _NOTHING)


def _pushed(push: Push, number: int, table: Cloud) -> Iterator[Message]:
    views = [push.before, *push.during, push.after]
    seen = [_particles(view, f"{number:06d}-{place}") for place, view in enumerate(views)]
    executed = Executed(
        id=MessageId(f"executed-{number:06d}"),
        cause=(seen[0].id,),
        time_s=_START_S + float(push.command.times_s[-1]),
        approved_id=_NOBODY,
        outcome="completed",
        reason="",
        times_s=_START_S + push.command.times_s,
        commanded=push.command.poses[:, :_POSE],
        measured=push.measured.poses[:, :_POSE] if push.measured is not None else np.zeros((0, _POSE)),
        openings=push.measured.poses[:, _POSE:].ravel() if push.measured is not None else np.zeros(0),
    )
    for place, (view, particles) in enumerate(zip(views, seen, strict=True)):
        if place == len(views) - 1:
            yield executed
        yield particles
        yield Sighting(
            id=MessageId(particles.id.replace("particles", "sighting")),
            cause=particles.cause,
            time_s=particles.time_s,
            tool=view.finger if view.finger is not None else _NOTHING,
            table=table if place == 0 else _NOTHING,
        )
    yield Transition(
        id=MessageId(f"transition-{number:06d}"),
        cause=(seen[0].id, executed.id, seen[-1].id),
        time_s=seen[-1].time_s,
        before=seen[0].positions,
        executed=executed,
        after=seen[-1].positions,
    )


def _particles(view: ProjectionView, name: str) -> Particles:
    return Particles(
        id=MessageId(f"particles-{name}"),
        time_s=_START_S + view.time_s,
        positions=view.points,
        surface=_NOTHING,
        reconstruction_s=0.0,
    )


def _frame(place_m: tuple[float, float, float], time_s: float, episode: int) -> Frame:
    """An empty image, for where the camera is: it looks straight down."""
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[:3, 3] = place_m
    camera = CameraModel(name="camera", width=2, height=2, K=np.eye(3), T_world_camera=T, depth_unit_m=0.001)
    return Frame(
        id=MessageId(f"frame-{episode:06d}"),
        time_s=_START_S + time_s,
        camera=camera,
        color=np.zeros((2, 2, 3), np.uint8),
        depth=np.zeros((2, 2), np.uint16),
    )
