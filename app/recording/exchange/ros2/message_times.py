"""Times of the messages of one topic of a bag, by which each is found again."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Self, TypeVar, final

import numpy as np
from jaxtyping import Bool, Float64, Int64

from app.core.errors import RecordingError
from app.recording.exchange.ros2.bag import NS, Bag, MessageStamp
from app.recording.exchange.streams.stream_map import StampSource

APART_S: Final = 0.1
"""Largest time between messages that are taken for one moment."""
_Message = TypeVar("_Message")


def header_ns(stamp: MessageStamp) -> int:
    """The header's time [ns]; that of receipt where it has none."""
    return stamp.received_ns if stamp.stamped_ns is None else stamp.stamped_ns


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class MessageTimes:
    """Messages of a topic by the chosen clock [s], increasing; their times of receipt [ns], and their frame."""

    bag: Bag
    topic: str
    times_s: Float64[np.ndarray, " V"]
    received_ns: Int64[np.ndarray, " V"]
    frame: str

    @classmethod
    def read(cls, bag: Bag, topic: str, clock: StampSource, origin_ns: int) -> Self:
        """Times of all messages, in seconds from `origin_ns`. Raises RecordingError where there is none."""
        stamps = list(bag.stamps([topic]))
        if not stamps:
            raise RecordingError(f"{bag.path}: {topic} holds no message; name another in the file of --topics.")
        times_ns = [header_ns(it) if clock == "header" else it.received_ns for it in stamps]
        times_s, first = np.unique((np.array(times_ns, np.int64) - origin_ns) / NS, return_index=True)
        received_ns = np.array([it.received_ns for it in stamps], np.int64)[first]
        return cls(bag=bag, topic=topic, times_s=times_s, received_ns=received_ns, frame=stamps[0].frame.lstrip("/"))

    def is_near(self, times_s: Float64[np.ndarray, " W"]) -> Bool[np.ndarray, " W"]:
        """Mask of the times about which there is a message."""
        return np.abs(self.times_s[self._nearest(times_s)] - times_s) <= APART_S

    def decode(self, time_s: float, decoding: Callable[[Any], _Message]) -> _Message:
        """The message nearest to a time, decoded. Raises RecordingError, naming the topic, where that fails."""
        at_ns = int(self.received_ns[self._nearest(np.array([time_s]))[0]])
        found = next((message for _, _, message in self.bag.messages([self.topic], at_ns, at_ns)), None)
        return decode_message(self.bag, self.topic, decoding, found)

    def _nearest(self, times_s: Float64[np.ndarray, " W"]) -> Int64[np.ndarray, " W"]:
        last = len(self.times_s) - 1
        after = np.clip(np.searchsorted(self.times_s, times_s), 0, last)
        before = np.maximum(after - 1, 0)
        later = np.abs(self.times_s[after] - times_s) < np.abs(self.times_s[before] - times_s)
        return np.where(later, after, before)


def decode_message(bag: Bag, topic: str, decoding: Callable[[Any], _Message], message: Any) -> _Message:
    """The message decoded. Raises RecordingError, naming the topic, where that fails."""
    try:
        return decoding(message)
    except (ValueError, AttributeError) as error:
        raise RecordingError(f"{bag.path}: {topic}: {error}.") from None
