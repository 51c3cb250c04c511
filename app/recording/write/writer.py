"""Recorder of an episode: messages go into a bounded queue, and one thread encodes and writes them in order."""

import queue
import re
import shutil
import threading
import time
from collections.abc import AsyncGenerator, Generator
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, Literal, final

import anyio
from anyio import to_thread

from app.core.errors import PreflightError, RecordingError
from app.core.messages import Episode, Message
from app.recording.format import digests
from app.recording.format.channels import topic_of
from app.recording.format.clock_offset import Epoch
from app.recording.format.names import numbered_names
from app.recording.write.file import EpisodeFile
from app.recording.write.preflight import Room, check_folder

FLUSH_PERIOD_S: Final = 0.25
"""Longest time [s] that a written message stays in this process, where a SIGKILL would lose it."""

_BOUND: Final = 64
"""Capacity of the writer thread's queue; with images about 100 MB."""

_END: Final = "end"


@asynccontextmanager
async def open_recording(folder: Path, episode: Episode, room: Room) -> AsyncGenerator["EpisodeRecorder"]:
    """A recorder that writes a new file in `folder`, named by the time of day (UTC), the task and the seed.

    The file is complete once the context is left, however it is left, and its SHA-256 is stored; where an error ends it
    before anything but the episode was written, there is no file. Raises PreflightError before anything is written
    where the folder cannot take a recording, and RecordingError on leaving where something was lost.
    """
    file = await to_thread.run_sync(start, folder, episode, room)
    recorder, failed = EpisodeRecorder(file), True
    try:
        await recorder.write(episode)
        yield recorder
        failed = False
    finally:
        with anyio.CancelScope(shield=True):
            await to_thread.run_sync(recorder.finish)
            if failed and recorder.empty:
                await to_thread.run_sync(recorder.remove)
    recorder.raise_failure()


@final
class EpisodeRecorder:
    """Lossless recorder in the order of the calls: `write` waits while the queue is full.

    `peak` is the longest the queue has been, `written` counts the messages in the file.
    """

    def __init__(self, file: EpisodeFile) -> None:
        self.path = file.path
        self.epoch = file.epoch
        self.peak = 0
        self.written = 0
        self._file = file
        self._failure: RecordingError | None = None
        self._queue: queue.SimpleQueue[_Entry | _Mark | Literal["end"]] = queue.SimpleQueue()
        self._ended = False
        self._ending = threading.Lock()
        self._room = threading.Semaphore(_BOUND)
        self._in_turn = anyio.Lock()
        self._thread = threading.Thread(target=self._write_all, name="recording", daemon=True)
        self._thread.start()

    async def write(self, message: Message) -> None:
        """Append a message; it is encoded by the writer thread.

        Raises RecordingError where the type has no channel, or an earlier message could not be written.
        """
        self.raise_failure()
        topic_of(type(message))
        came_s = time.monotonic()
        async with self._in_turn:
            if not self._room.acquire(blocking=False):
                await to_thread.run_sync(self._room.acquire)
            if self._failure is not None:
                self._room.release()
                raise self._failure
            self._queue.put(_Entry(message=message, came_s=came_s))
            self.peak = max(self.peak, self._queue.qsize())

    async def flush(self) -> int:
        """Wait until all that was written before is readable in the file; returns its size [byte] then.

        Raises RecordingError where something could not be written, or the file is closed.
        """
        self.raise_failure()
        mark = _Mark()
        with self._ending:
            if self._ended:
                raise RecordingError(f"{self.path} is closed already; nothing more comes into it.")
            self._queue.put(mark)
        await to_thread.run_sync(mark.reached.wait)
        self.raise_failure()
        return mark.size_bytes

    def finish(self) -> None:
        """Write the queued messages and close the file. Blocks until that is done."""
        with self._ending:
            self._ended = True
            self._queue.put(_END)
        self._thread.join()

    @property
    def empty(self) -> bool:
        """True where the file received nothing but the episode."""
        return self.written <= 1 and self._failure is None

    def remove(self) -> None:
        """Delete the closed file and its checksum, as far as possible."""
        # The error that ended the episode matters, not a failure to clean up.
        with suppress(OSError, RecordingError):
            self.path.unlink(missing_ok=True)
            digests.forget(self.path)

    def raise_failure(self) -> None:
        """Raises RecordingError where a message could not be written."""
        if self._failure is not None:
            raise self._failure

    def _write_all(self) -> None:
        """The writer thread: message after message, flushed every period, until the end mark."""
        flush_at_s = time.monotonic() + FLUSH_PERIOD_S
        while (entry := self._next(flush_at_s)) is not _END:
            if isinstance(entry, _Entry):
                with self._noting_failure():
                    self._file.write(entry.message, now_s=entry.came_s)
                    self.written += 1
                self._room.release()
            if isinstance(entry, _Mark) or time.monotonic() >= flush_at_s:
                with self._noting_failure():
                    self._file.flush()
                if isinstance(entry, _Mark):
                    entry.size_bytes = self._file.size_bytes
                    entry.reached.set()
                flush_at_s = time.monotonic() + FLUSH_PERIOD_S
        with self._noting_failure():
            self._file.close()
            digests.note(self.path)

    def _next(self, until_s: float) -> "_Entry | _Mark | Literal['end'] | None":
        """The next entry, None where none comes in time."""
        try:
            return self._queue.get(timeout=max(0.0, until_s - time.monotonic()))
        except queue.Empty:
            return None

    @contextmanager
    def _noting_failure(self) -> Generator[None]:
        """Keep the first error for the next write: the thread itself goes on, so that no caller waits for ever."""
        try:
            yield
        except BaseException as error:  # whatever is raised, a panic of the SDK too: a dead thread would lose the rest
            if self._failure is None:
                self._failure = RecordingError(
                    f"The recording {self.path} is incomplete: {error}{self._room_left()}. Make room if that is what "
                    f"lacks; `dipac recordings recover {self.path}` saves what is intact."
                )

    def _room_left(self) -> str:
        """Free space on the disk in words, empty where the folder is gone."""
        with suppress(OSError):
            return f" ({shutil.disk_usage(self.path.parent).free / 1e9:.2f} GB free on its disk)"
        return ""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class _Entry:
    """A message and the monotonic time [s] of its arrival."""

    message: Message
    came_s: float


@final
class _Mark:
    """A position in the queue: `reached` once the thread is there, with the size of the file [byte]."""

    def __init__(self) -> None:
        self.reached = threading.Event()
        self.size_bytes = 0


def start(folder: Path, episode: Episode, room: Room, *, part: str = "", epoch: Epoch | None = None) -> EpisodeFile:
    """A new file in `folder`, which is checked first; `part` is added to its name. Raises PreflightError.

    Without an `epoch`, messages are dated by this machine's clocks from now on.
    """
    check_folder(folder, room)
    words = (f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}", _plain(episode.task), part, f"seed{episode.seed}")
    path = unused_path(folder, "-".join(filter(None, words)))
    try:
        return EpisodeFile(path, episode, epoch=epoch)
    except (OSError, RuntimeError) as error:
        raise PreflightError(f"Cannot start {path} ({error}); choose another recordings folder.") from error


def unused_path(folder: Path, stem: str) -> Path:
    """An unused path in `folder`, also for a second episode within one second."""
    return next(path for name in numbered_names(stem) if not (path := folder / f"{name}.mcap").exists())


def _plain(task: str) -> str:
    """`task` as part of a file name."""
    return re.sub(r"[^A-Za-z0-9_]+", "-", task)
