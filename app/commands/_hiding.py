"""Rehearsals as recordings: images to particles, particles and motions to messages, messages to files.

Nothing in a recording depends on what is hidden but through what was seen and measured: no seed, no name, and a clock
that starts at a fixed value. The same session gives the same bytes.
"""

import json
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, TypeAlias, final

import numpy as np
from jaxtyping import Float32

from app import __version__
from app.core.errors import PerceptionError, RecordingError
from app.core.geometry.track import Track
from app.core.messages import Episode, Executed, Frame, Message, MessageId, Particles, Sighting, Transition
from app.perception.find_tool import find_tool
from app.perception.reconstruct import reconstruct
from app.perception.tool_and_table_points import table_points
from app.policy.random_pushes import PushDesign
from app.recording.format.clock_offset import Epoch
from app.recording.write.file import EpisodeFile
from app.rig.simulated.cameras.cameras import CameraNoise
from app.rig.simulated.cameras.simulated_cameras import SimulatedCameras
from app.rig.simulated.injected_effects.base import InjectedEffect
from app.rig.simulated.push_session import PushSample, PushSession, StampedSnapshot
from app.rig.simulated.worlds.physics import WorldPhysics
from app.session.loop import complete, go_round
from app.tasks.elements.base import Task

Some: TypeAlias = Float32[np.ndarray, "_ 3"]
"""Any number of points [m]."""

_PRESET: Final = "cpu"
"""Whose number of particles clouds have."""
_LOOKS: Final = 3
_POSE: Final = 7
"""Numbers of a pose, after which a track may have the opening."""
_EPOCH: Final = Epoch(offset_ns=0)
"""Recordings are dated by the world's clock alone."""
_NOBODY: Final = MessageId("rehearsed")
"""Id in place of an approval, which a rehearsal does not need."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class PushRecordingConfig:
    """Random pushes to be recorded, and the folder for them; `cameras`: their number, with `noise`."""

    task: Task
    plan: PushDesign
    physics: WorldPhysics
    hidden: tuple[InjectedEffect, ...]
    seed: int
    folder: Path
    cameras: int = 2
    noise: CameraNoise = field(default_factory=CameraNoise)

    def path(self, episode: int) -> Path:
        """The recording of an episode, counted from 0."""
        return self.folder / f"episode-{episode + 1:02d}.mcap"


@final
@dataclass(kw_only=True)
class Stopwatch:
    """Time spent on each part of a task [s]."""

    spent_s: dict[str, float] = field(default_factory=dict[str, float])

    @contextmanager
    def on(self, part: str) -> Generator[None]:
        """Context manager that counts its body as time of this part."""
        began_s = time.perf_counter()
        try:
            yield
        finally:
            self.spent_s[part] = self.spent_s.get(part, 0.0) + time.perf_counter() - began_s


def record(session: PushRecordingConfig, watch: Stopwatch) -> Iterator[Path]:
    """Make and write all pushes; after each, the recording that it stands in.

    Raises PerceptionError where the object cannot be seen any more, RecordingError where a file cannot be written.
    """
    cell = RecordedCell(session, watch)
    stages = _RandomPushes(cell)
    with cell.recording():
        while cell.number < session.plan.episodes * session.plan.pushes:
            path = session.path(cell.episode)
            complete(go_round(stages))
            yield path


@final
class _RandomPushes:
    """Stages of the loop for pushes that are drawn at random: nobody is asked, and nothing real moves."""

    def __init__(self, cell: "RecordedCell") -> None:
        self._cell = cell

    async def observe(self) -> Particles:
        """The object at rest."""
        return self._cell.look()

    async def plan(self, observed: Particles) -> Track:  # noqa: ARG002
        """A push across the object where it truly lies."""
        return self._cell.world.random()

    async def approve(self, plan: Track) -> Track:
        """The push as it is."""
        return plan

    async def execute(self, leave: Track) -> PushSample:
        """The push as the world made it."""
        return self._cell.push(leave)

    async def learn(self, made: PushSample) -> None:
        """Record it."""
        self._cell.record(made)


@final
class RecordedCell:
    """The world with hidden effects, and the cameras and files of its recordings: look, push, record, and so on."""

    def __init__(self, session: PushRecordingConfig, watch: Stopwatch) -> None:
        self.world = PushSession(session.task, session.plan, session.physics, session.hidden, session.seed)
        self._session, self._watch, self._scribe = session, watch, Scribe(session, watch)
        self._file: EpisodeFile | None = None
        self._seen: tuple[Particles, list[Message]] | None = None

    @property
    def number(self) -> int:
        """Index of the next push, from 0."""
        return self.world.number

    @property
    def episode(self) -> int:
        """Index of the next push's episode, from 0."""
        return self.world.episode

    def look(self) -> Particles:
        """The object before the next push; seen once, however often that is asked before it is pushed."""
        if self._seen is None:
            with self._watch.on("physics"):
                look = self.world.look()
            self._seen = self._scribe.before(look, self.number)
        return self._seen[0]

    def push(self, command: Track) -> PushSample:
        """Make the push, which must begin after `look`."""
        with self._watch.on("physics"):
            return self.world.push(command)

    def record(self, made: PushSample) -> tuple[Particles, list[Message]]:
        """Write the push that was made last; the object before it, and what was observed and measured then."""
        assert self._seen is not None, "a push is made of an object that was looked at"
        (before, messages), self._seen = self._seen, None
        told = self._scribe.after(before, made, self.number - 1)
        with self._watch.on("writing"):
            path = self._session.path(made.episode)
            if self._file is None or self._file.path != path:
                self._close()
                self._file = _begun_file(self._session, made.episode, made.before.stamp_s)
            for message in (*messages, *told):
                self._file.write(message, now_s=message.time_s)
        return before, told

    @contextmanager
    def recording(self) -> Generator[None]:
        """Context manager that closes the file in the end. Raises RecordingError where one cannot be written."""
        try:
            yield
        except (OSError, RuntimeError) as error:
            folder = self._session.folder
            raise RecordingError(f"Cannot write to {folder}: {error}; choose another place with -o.") from error
        finally:
            self._close()

    def _close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None


def _begun_file(session: PushRecordingConfig, episode: int, time_s: float) -> EpisodeFile:
    """A new file with its first message, which says no more than any episode of a simulated cell would."""
    first = Episode(
        id=MessageId(f"episode-{episode:06d}"),
        time_s=time_s,
        task=session.task.name,
        rig="simulated",
        seed=0,
        simulated=True,
        code_version=__version__,
        config=json.dumps({"preset": _PRESET, "pushes": session.plan.pushes}),
    )
    file = EpisodeFile(session.path(episode), first, epoch=_EPOCH)
    file.write(first, now_s=first.time_s)
    return file


@final
class Scribe:
    """Says what cameras and encoders say of a push."""

    def __init__(self, session: PushRecordingConfig, watch: Stopwatch) -> None:
        self._watch, self._pushes, self._task = watch, session.plan.pushes, session.task
        self._eyes = SimulatedCameras(
            session.task.stage, session.hidden, session.seed, count=session.cameras, noise=session.noise
        )
        self._how = session.task.reconstruction(_PRESET)

    def before(self, look: StampedSnapshot, number: int) -> tuple[Particles, list[Message]]:
        """The object before push `number`, and all messages of then. An episode's first ones bring images."""
        before, images = self._observe(look, _LOOKS * number)
        first = number % self._pushes == 0
        with self._watch.on("particles"):
            table = table_points(images, self._how) if first else _nothing()
        shown: list[Message] = [*images] if first else []
        return before, [*shown, before, _sighting(before, tool=_nothing(), table=table)]

    def after(self, before: Particles, take: PushSample, number: int) -> list[Message]:
        """Messages observed and measured of push `number` once it is made.

        There is no view from its middle where the tool that holds the object hides it then.
        """
        during, views = self._during(before, take.during, _LOOKS * number + 1)
        after, _ = self._observe(take.after, _LOOKS * number + 2)
        with self._watch.on("particles"):
            pose = take.measured.poses_at(np.array([take.during.stamp_s]))[0]
            tool = find_tool(views, pose, self._task.stage.tool, self._how)
        executed = _execution(take, number, before)
        seen = [] if during is None else [during, _sighting(during, tool=tool, table=_nothing())]
        return [
            *seen,
            executed,
            after,
            Transition.between(before, executed, after, named=MessageId(f"transition-{number:06d}")),
        ]

    def _observe(self, look: StampedSnapshot, number: int) -> tuple[Particles, list[Frame]]:
        """The object in new images."""
        frames = self._images(look, number)
        return self._particles(look, frames, number), frames

    def _during(self, before: Particles, look: StampedSnapshot, number: int) -> tuple[Particles | None, list[Frame]]:
        """The object in new images; None where the tool that holds it hides it.

        In a bowl it is then as it was `before`: of what is poured no view in a motion is compared.
        """
        frames = self._images(look, number)
        try:
            return self._particles(look, frames, number), frames
        except PerceptionError:
            if look.told is None:
                raise
        if self._how.held is None:
            return None, frames
        causes = tuple(frame.id for frame in frames)
        return replace(before, id=_particles_id(number), cause=causes, time_s=look.stamp_s), frames

    def _images(self, look: StampedSnapshot, number: int) -> list[Frame]:
        with self._watch.on("images"):
            return self._eyes.look(look.snapshot, stamp_s=look.stamp_s, number=number)

    def _particles(self, look: StampedSnapshot, frames: Sequence[Frame], number: int) -> Particles:
        with self._watch.on("particles"):
            found = reconstruct(frames, self._how, look.told)
        return Particles(
            id=_particles_id(number),
            cause=tuple(frame.id for frame in frames),
            time_s=look.stamp_s,
            positions=found.positions,
            surface=found.surface,
            # A rehearsal takes none of the world's time.
            reconstruction_s=0.0,
        )


def _particles_id(number: int) -> MessageId:
    return MessageId(f"particles-{number:06d}")


def _sighting(particles: Particles, *, tool: Some, table: Some) -> Sighting:
    identity = MessageId(particles.id.replace("particles", "sighting"))
    return Sighting(id=identity, cause=particles.cause, time_s=particles.time_s, tool=tool, table=table)


def _execution(take: PushSample, number: int, before: Particles) -> Executed:
    return Executed(
        id=MessageId(f"executed-{number:06d}"),
        cause=(before.id,),
        time_s=take.command.end_s,
        approved_id=_NOBODY,
        outcome="completed",
        reason="",
        times_s=take.command.times_s,
        commanded=take.command.poses[:, :_POSE],
        measured=take.measured.poses[:, :_POSE],
        openings=take.measured.poses[:, _POSE:].ravel(),
    )


def _nothing() -> Some:
    return np.zeros((0, 3), np.float32)
