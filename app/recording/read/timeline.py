"""Random access to a recording: the state known at any moment, and the messages after it.

Large or frequent kinds (images, particles, plans, the arm) matter by their newest message alone to a viewer of one
moment; all other kinds are a short history, kept in memory. So a jump reads a handful of messages, wherever they lie,
and none of the images in between.
"""

import threading
from bisect import bisect_right
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Final, final

from mcap.reader import McapReader, make_reader

from app.core.dialogue.requests import GoalRequest, PictureGoalRequest
from app.core.dialogue.segmentation_message import Seen
from app.core.errors import RecordingError
from app.core.messages import (
    ArmState,
    Episode,
    Executed,
    Frame,
    Goal,
    Health,
    Message,
    Model,
    Particles,
    Proposal,
    Sighting,
    Transition,
)
from app.recording.format.channels import KINDS, TOPICS
from app.recording.format.index import Times, frame_times, log_times
from app.recording.format.integrity import DAMAGE, damage_error, inspect, reading, version_of
from app.recording.read.event_index import Mark, marks_of
from app.recording.read.reader import Logged, logged_messages

NEWEST: Final = (
    Frame,
    Particles,
    Sighting,
    Seen,
    Goal,
    Proposal,
    Executed,
    Transition,
    ArmState,
    Health,
    GoalRequest,
    PictureGoalRequest,
)
"""Kinds whose newest message supersedes the earlier ones; of frames, the newest of each camera."""

_HISTORY: Final = tuple(kind for kind in TOPICS if kind not in NEWEST)
_NS: Final = 1_000_000_000


@contextmanager
def open_timeline(path: Path, told: Callable[[float], object] = lambda _: None) -> Generator["Timeline"]:
    """The timeline of the recording `path`, for as long as the block lasts; `told` receives the share read so far.

    Raises as `read_messages`, and RecordingError where nothing was recorded.
    """
    metadata = inspect(path)
    offset = metadata.get("epoch_offset_ns", "")
    with reading(path):
        stream = path.open("rb")
    with stream:
        offset_ns = int(offset) if offset.lstrip("-").isdecimal() else None
        timeline = _index(path, stream, version_of(metadata), offset_ns, told)
        yield timeline


def _index(
    path: Path, stream: IO[bytes], version: int, offset_ns: int | None, told: Callable[[float], object]
) -> "Timeline":
    with reading(path):
        try:
            reader = make_reader(stream, validate_crcs=True)
            times = log_times(reader, stream)
            said = [each for topic, each in times.items() if each and topic in KINDS]
            if not said:
                raise RecordingError(f"{path} holds no message; there is nothing to replay.")
            first_ns, last_ns = min(each[0] for each in said), max(each[-1] for each in said)
            history = list[Logged]()
            for logged in logged_messages(reader, _HISTORY, version):
                history.append(logged)
                told((logged.log_time_ns - first_ns) / max(last_ns - first_ns, 1))
        except DAMAGE as error:
            raise damage_error(path, error) from error
    offset_ns = first_ns if offset_ns is None else offset_ns
    return Timeline(path, reader, version, times, history, span_ns=(first_ns, last_ns), offset_ns=offset_ns)


@final
class Timeline:
    """Content of a recording, by the seconds since its first message. Every method may be called from any thread.

    `marks`: the events worth a visit, in order; `models`: all versions of the model, in order.
    """

    def __init__(
        self,
        path: Path,
        reader: McapReader,
        version: int,
        times: Times,
        history: Sequence[Logged],
        *,
        span_ns: tuple[int, int],
        offset_ns: int,
    ) -> None:
        self.path = path
        self._reader, self._version = reader, version
        self._times, self._history = times, history
        self._first_ns, last_ns = span_ns
        self._offset_ns = offset_ns
        self._history_ns = [logged.log_time_ns for logged in history]
        self._frames_ns = list(frame_times(times).values())
        self._reading = threading.Lock()
        self.duration_s = (last_ns - self._first_ns) / _NS
        self.marks: tuple[Mark, ...] = tuple(marks_of(times, history, self._first_ns))
        self.models = tuple(logged.message for logged in history if isinstance(logged.message, Model))

    def episode(self, time_s: float) -> Episode:
        """Episode at `time_s`: imported recordings hold several. Raises RecordingError where none is recorded."""
        known = [logged for logged in self._history if isinstance(logged.message, Episode)]
        begun = [logged for logged in known if logged.log_time_ns <= self._ns(time_s)] or known
        if not begun:
            raise RecordingError(f"{self.path} names no episode; it was cut off before its first message.")
        message = begun[-1].message
        assert isinstance(message, Episode)
        return message

    def clock(self, time_s: float) -> float:
        """Monotonic time [s] of the recording machine, by which messages are dated, at `time_s`."""
        return (self._ns(time_s) - self._offset_ns) / _NS

    def at(self, time_s: float) -> list[Message]:
        """Messages that make up the state known at `time_s`, in order.

        For large and frequent kinds that is the newest message, for frames the newest of each camera, for plans also
        the one that the newest transition is about; for all other kinds, everything. Raises RecordingError where a
        needed part is damaged.
        """
        return self._gist(self._first_ns - 1, self._ns(time_s))

    def gist(self, after_s: float, until_s: float) -> list[Message]:
        """Messages of `between(after_s, until_s)` that still matter at `until_s`, as an update of `at(after_s)`."""
        return self._gist(self._ns(after_s), self._ns(until_s))

    def between(self, after_s: float, until_s: float) -> list[Message]:
        """Every message later than `after_s` until `until_s`, in order. Raises as `at`."""
        after_ns, until_ns = self._ns(after_s), self._ns(until_s)
        if until_ns <= after_ns:
            return []
        return [logged.message for logged in self._read(tuple(TOPICS), after_ns + 1, until_ns)]

    def plan_about(self, time_s: float) -> Proposal | None:
        """The plan that was up or being executed at `time_s`, or else the next one; or else the last before."""
        plans, ends = self._times.get(TOPICS[Proposal], ()), self._times.get(TOPICS[Executed], ())
        now_ns = self._ns(time_s)
        last = bisect_right(plans, now_ns)
        ended_ns = ends[bisect_right(ends, now_ns) - 1] if ends and ends[0] <= now_ns else -1
        over = last == 0 or ended_ns > plans[last - 1]
        index = last if over and last < len(plans) else last - 1
        found = self._at_ns(Proposal, plans[index]) if index >= 0 else []
        return next((logged.message for logged in found if isinstance(logged.message, Proposal)), None)

    def _ns(self, time_s: float) -> int:
        return self._first_ns + round(time_s * _NS)

    def _gist(self, after_ns: int, until_ns: int) -> list[Message]:
        begin, end = bisect_right(self._history_ns, after_ns), bisect_right(self._history_ns, until_ns)
        picked = list(self._history[begin:end])
        for kind, log_time_ns in self._newest(after_ns, until_ns):
            picked += self._at_ns(kind, log_time_ns)
        return [logged.message for logged in sorted(picked, key=lambda logged: logged.log_time_ns)]

    def _newest(self, after_ns: int, until_ns: int) -> Iterator[tuple[type[Message], int]]:
        """Kind and log time of each large message that still matters at `until_ns`."""
        wanted = set[tuple[type[Message], int]]()
        for kind in NEWEST:
            for times in self._frames_ns if kind is Frame else (self._times.get(TOPICS[kind], ()),):
                if (found := bisect_right(times, until_ns)) and times[found - 1] > after_ns:
                    wanted.add((kind, times[found - 1]))
        # A transition is compared with the plan that was up then; another may be up by now.
        seen_ns = max((time for kind, time in wanted if kind is Transition), default=after_ns)
        plans = self._times.get(TOPICS[Proposal], ())
        if (found := bisect_right(plans, seen_ns)) and plans[found - 1] > after_ns:
            wanted.add((Proposal, plans[found - 1]))
        yield from wanted

    def _at_ns(self, kind: type[Message], log_time_ns: int) -> list[Logged]:
        return self._read((kind,), log_time_ns, log_time_ns)

    def _read(self, kinds: tuple[type[Message], ...], first_ns: int, last_ns: int) -> list[Logged]:
        with self._reading, reading(self.path):
            try:
                return list(logged_messages(self._reader, kinds, self._version, first_ns=first_ns, last_ns=last_ns))
            except DAMAGE as error:
                raise damage_error(self.path, error) from error
