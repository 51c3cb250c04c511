"""Offset between monotonic time and wall-clock time, fixed once an episode, so that clock changes do not matter."""

import time
from dataclasses import dataclass
from typing import Self, final

from foxglove.messages import Timestamp

_NS = 1_000_000_000


@final
@dataclass(frozen=True, kw_only=True)
class Epoch:
    """The offset [ns] from monotonic time to the time since 1970 UTC."""

    offset_ns: int

    @classmethod
    def now(cls) -> Self:
        """The offset at this moment."""
        return cls(offset_ns=time.time_ns() - time.monotonic_ns())

    def ns(self, time_s: float) -> int:
        """Time since 1970 [ns] of a monotonic time [s]."""
        return self.offset_ns + round(time_s * _NS)

    def stamp(self, time_s: float) -> Timestamp:
        """Time since 1970 as Foxglove's timestamp."""
        sec, nsec = divmod(self.ns(time_s), _NS)
        return Timestamp(sec=sec, nsec=nsec)
