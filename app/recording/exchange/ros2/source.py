"""A bag of ROS 2: its topics as a list, their likeliest mapping, and the episode that a mapping selects."""

import itertools
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Self, final

import numpy as np

from app.core.errors import RecordingError
from app.recording.exchange.ros2 import guess
from app.recording.exchange.ros2.bag import NS, Bag, MessageStamp
from app.recording.exchange.ros2.message_times import header_ns
from app.recording.exchange.ros2.reading import BagReading, read_tree
from app.recording.exchange.streams.measured_episode import MeasuredEpisode
from app.recording.exchange.streams.stream_list import StreamInfo, StreamList
from app.recording.exchange.streams.stream_map import StampSource, StreamMap

_TWO_CLOCKS_S: Final = 0.5
"""Difference between topics, of header stamp and time of receipt, from which their headers have different clocks."""
_ASKED: Final = 10
"""Messages of each topic whose stamps are compared."""
_WIDEST: Final = 100


@final
class BagSource:
    """An opened bag; see `ForeignSource`."""

    def __init__(self, bag: Bag) -> None:
        self._bag = bag

    @cached_property
    def _first_messages(self) -> Mapping[str, Any]:
        """The first message of each topic that can be read; what cannot be decoded is left out."""
        found = dict[str, Any]()
        for name in (it.name for it in self._bag.topics.values() if it.kind in guess.READ and it.count):
            with suppress(RecordingError):
                found[name] = self._bag.first(name)
        return {name: message for name, message in found.items() if message is not None}

    @cached_property
    def _clocks(self) -> "_Clocks":
        headed = [name for name, message in self._first_messages.items() if hasattr(message, "header")]
        return _Clocks.of({name: list(itertools.islice(self._bag.stamps([name]), _ASKED)) for name in headed})

    @property
    def stream_list(self) -> StreamList:
        """List of the topics; the notes say what the clocks do."""
        bag = self._bag
        topics = [topic for _, topic in sorted(bag.topics.items())]
        return StreamList(
            title=f"{bag.path}: a bag of ROS 2, {bag.duration_s:.1f} s, {sum(it.count for it in topics)} messages.",
            streams=tuple(
                StreamInfo(name=it.name, kind=it.kind or "several types", count=it.count, detail=self._detail(it.name))
                for it in topics
            ),
            notes=self._clocks.notes,
        )

    def guess(self) -> StreamMap:
        """Mapping by types, names and first messages."""
        clock: StampSource = "receive" if self._clocks.notes else "header"
        return guess.guess_map(self._bag.topics, self._first_messages, read_tree(self._bag, clock, 0), clock)

    def episodes(self, streams: StreamMap) -> list[MeasuredEpisode]:
        """The bag as one episode. Raises RecordingError, see `ForeignSource`."""
        streams.require(sorted(self._bag.topics), self._bag.path)
        origin_ns = self._bag.start_ns if streams.clock == "receive" else self._clocks.first_ns
        tree = read_tree(self._bag, streams.clock, origin_ns)
        return [BagReading(self._bag, streams, self._first_messages, tree, origin_ns).episode()]

    def _detail(self, name: str) -> str:
        message, kind = self._first_messages.get(name), self._bag.topics[name].kind
        if message is None:
            read = kind in guess.READ
            return "cannot be decoded" if read and self._bag.topics[name].count else "" if read else "not read"
        match kind:
            case guess.IMAGE:
                text = f"{message.width}x{message.height} {message.encoding}, frame {message.header.frame_id}"
            case guess.COMPRESSED:
                text = f"{message.format}, frame {message.header.frame_id}"
            case guess.CLOUD:
                fields = " ".join(it.name for it in message.fields)
                text = f"{message.width * message.height} points of {fields}, frame {message.header.frame_id}"
            case guess.JOINTS:
                text = " ".join(message.name)
            case guess.TRANSFORMS:
                text = " ".join(sorted({it.child_frame_id for it in message.transforms}))
            case _:
                text = f"frame {message.header.frame_id}" if hasattr(message, "header") else ""
        return text if len(text) <= _WIDEST else f"{text[: _WIDEST - 3]}..."


@final
@dataclass(frozen=True, kw_only=True)
class _Clocks:
    """Clocks of the messages: the first header stamp [ns], and remarks on headers that are no common clock."""

    first_ns: int
    notes: tuple[str, ...]

    @classmethod
    def of(cls, stamps: Mapping[str, list[MessageStamp]]) -> Self:
        """Clocks by the first messages of each topic with a header."""
        late_s, bare = dict[str, float](), list[str]()
        for name, found in stamps.items():
            stamped = [it for it in found if it.stamped_ns is not None]
            if stamped:
                late_s[name] = float(np.median([(header_ns(it) - it.received_ns) / NS for it in stamped]))
            elif found:
                bare.append(name)
        notes = list[str]()
        if bare:
            notes.append(f"No stamps in the headers of {', '.join(bare)}: messages are dated by their receipt.")
        elif late_s and max(late_s.values()) - min(late_s.values()) > _TWO_CLOCKS_S:
            low, high = min(late_s, key=late_s.__getitem__), max(late_s, key=late_s.__getitem__)
            notes.append(
                f"Headers have several clocks: against its receipt {low} is stamped {late_s[low]:.3f} s, {high} "
                f"{late_s[high]:.3f} s; messages are dated by their receipt, which errs by what transport took."
            )
        firsts = [header_ns(it) for found in stamps.values() for it in found[:1]]
        return cls(first_ns=min(firsts, default=0), notes=tuple(notes))
