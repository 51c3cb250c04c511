"""The session's recording, with demonstrations and clips as files of their own beside it."""

import itertools
import json
import math
import time
from collections.abc import AsyncGenerator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, cast, final

import anyio
from anyio import to_thread

from app.core.errors import RecordingError, UsageError
from app.core.messages import Episode, Message, MessageId, Transition, fresh_id
from app.core.task_name import recorded_name
from app.recording.format import digests
from app.recording.library.clip import Cut, write_clip
from app.recording.library.label import Label, SuccessLabel, relabel
from app.recording.library.prune import discard
from app.recording.read.reader import read_episode, read_transitions
from app.recording.write.file import EpisodeFile
from app.recording.write.preflight import Room, check_folder
from app.recording.write.writer import EpisodeRecorder, open_recording, start, unused_path


@asynccontextmanager
async def open_studio(
    folder: Path, episode: Episode, room: Room, *, take_bytes: int = 0
) -> AsyncGenerator["SessionRecorder"]:
    """A recorder like `open_recording`, with demonstrations of up to `take_bytes` each, and clips.

    A demonstration that is open when the context is left is closed and kept, unlabelled. Raises as `open_recording`,
    and RecordingError on leaving where part of that demonstration was lost: the session's own file is complete then.
    """
    take: EpisodeRecorder | None = None
    async with open_recording(folder, episode, room) as recorder:
        studio = SessionRecorder(recorder, episode, room, take_bytes=take_bytes)
        try:
            yield studio
        finally:
            with anyio.CancelScope(shield=True):
                take = await studio.close()
    if take is not None:
        take.raise_failure()


@final
class SessionRecorder:
    """Recorder into the session's file, and into that of the open demonstration.

    `room`: disk limits of the session; a demonstration is expected to take `take_bytes`.
    """

    def __init__(self, recorder: EpisodeRecorder, episode: Episode, room: Room, *, take_bytes: int) -> None:
        self._session = recorder
        self._episode = episode
        self._room = room
        self._take_bytes = take_bytes
        self._began_s = time.monotonic()
        self._take: EpisodeRecorder | None = None
        self._opening = frozenset[MessageId]()
        self._takes = itertools.count(1)
        self._clips = itertools.count(1)
        self._in_turn = anyio.Lock()
        self._one_at_a_time = anyio.Lock()

    @property
    def path(self) -> Path:
        """The session's own file."""
        return self._session.path

    @property
    def written(self) -> int:
        """Number of messages in the session's own file."""
        return self._session.written

    async def write(self, message: Message) -> None:
        """Append a message. Raises RecordingError as `EpisodeRecorder.write`, for the session's own file alone."""
        async with self._in_turn:
            await self._session.write(message)
            # A message on its way when a demonstration began may be among its opening ones.
            if self._take is not None and message.id not in self._opening:
                # Losses of a demonstration are reported when it ends. It must hold all that the session does.
                with anyio.CancelScope(shield=True), suppress(RecordingError):
                    await self._take.write(message)

    async def begin(self, opening: Callable[[], Sequence[Message]]) -> Path:
        """Start a file that begins with the messages of `opening`, and receives everything recorded from now on.

        Raises PreflightError where it does not fit on the disk, and RecordingError where one is open.
        """
        async with self._one_at_a_time:
            if self._take is not None:
                raise RecordingError(f"{self._take.path.name} is still being recorded; end that demonstration first.")
            number = next(self._takes)
            episode = self._part(time.monotonic(), demonstration=number)
            take = EpisodeRecorder(await to_thread.run_sync(self._start, episode, f"demo{number}"))
            with anyio.CancelScope(shield=True):
                async with self._in_turn:
                    told = (episode, *opening())
                    self._take, self._opening = take, frozenset(message.id for message in told)
                    with suppress(RecordingError):
                        for message in told:
                            await take.write(message)
            return take.path

    async def end(self, said: Literal["success", "failure"] | None, *, operator: str) -> None:
        """Close the file with its label; None removes it: its content is in the session's own recording.

        Raises RecordingError where none is open, or it cannot be written.
        """
        async with self._one_at_a_time:
            with anyio.CancelScope(shield=True):
                take = await self._detach_take()
                if take is None:
                    raise RecordingError("No demonstration is being recorded; begin one first.")
                await to_thread.run_sync(_end, take, said, operator)

    async def demonstration(self, recording: str) -> tuple[str, Sequence[Transition]]:
        """Task and motions of a demonstration in the session's folder, by its file's name.

        Raises UsageError where there is none of that name, and RecordingError where it cannot be read.
        """
        return await to_thread.run_sync(_demonstration_in, self.path.parent, recording)

    async def clip(self, duration_s: float) -> Path:
        """Write the last `duration_s` of the running session's recording to a file of its own.

        Raises PreflightError where it does not fit on the disk, and RecordingError where it cannot be written, or
        `duration_s` is not a positive time.
        """
        if not 0 < duration_s < math.inf:
            raise RecordingError(f"A clip of {duration_s:g} s cannot be; ask for a number of seconds, such as 30.")
        now_s = time.monotonic()
        since_s = max(now_s - duration_s, self._began_s)
        number = next(self._clips)
        cut = Cut(
            session=self.path,
            size_bytes=await self._session.flush(),
            since_ns=self._session.epoch.ns(now_s - duration_s),
            episode=self._part(since_s, clip=number),
            epoch=self._session.epoch,
        )
        share = (now_s - since_s) / max(now_s - self._began_s, 1.0)
        return await to_thread.run_sync(self._write_clip, cut, number, round(share * cut.size_bytes))

    async def close(self) -> EpisodeRecorder | None:
        """End the open demonstration, without a label, and return it."""
        async with self._one_at_a_time:
            take = await self._detach_take()
            if take is not None:
                await to_thread.run_sync(take.finish)
            return take

    async def _detach_take(self) -> EpisodeRecorder | None:
        """Detach and return the open demonstration; it receives nothing more."""
        async with self._in_turn:
            take, self._take = self._take, None
            return take

    def _part(self, began_s: float, **told: int) -> Episode:
        """The session's episode, as that of a part of it that began at `began_s`."""
        config = json.dumps(_object(self._episode.config) | told | {"session": self.path.name})
        return replace(self._episode, id=fresh_id("episode"), cause=(), time_s=began_s, config=config)

    def _start(self, episode: Episode, part: str) -> EpisodeFile:
        room = self._room_for(self._take_bytes)
        return start(self.path.parent, episode, room, part=part, epoch=self._session.epoch)

    def _write_clip(self, cut: Cut, number: int, expected_bytes: int) -> Path:
        check_folder(self.path.parent, self._room_for(expected_bytes))
        goal = unused_path(self.path.parent, f"{self.path.stem}-clip{number}")
        write_clip(cut, goal)
        return goal

    def _room_for(self, expected_bytes: int) -> Room:
        """Disk limits of one more file of so many bytes that leave the session its expected size."""
        with suppress(OSError):
            expected_bytes += max(0, self._room.expected_bytes - self.path.stat().st_size)
        return replace(self._room, expected_bytes=expected_bytes)


def _demonstration_in(folder: Path, recording: str) -> tuple[str, Sequence[Transition]]:
    path = folder / recording
    plain = recording.isprintable() and path.name == recording
    if not plain or path.suffix != ".mcap" or not _is_file(path):  # A browser may ask for anything.
        raise UsageError(f"There is no demonstration {recording!r} in {folder}; name a file of that folder.")
    return recorded_name(read_episode(path).task), read_transitions(path)


def _is_file(path: Path) -> bool:
    """True for a file; false for a name that no file can have, too, such as one that is too long."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _end(take: EpisodeRecorder, said: SuccessLabel | None, operator: str) -> None:
    take.finish()
    if said is None:
        discard(take.path)
        return
    take.raise_failure()
    relabel(take.path, Label.now(said, note="", operator=operator))
    digests.note(take.path)


def _object(config: str) -> dict[str, Any]:
    """The configuration as a JSON object."""
    with suppress(ValueError):
        said: Any = json.loads(config)
        if isinstance(said, dict):
            return cast(dict[str, Any], said)
    return {"config": config}
