"""Lock-free memory shared by processes: one writes, the others read, and none ever waits for another.

A process that is killed at any point can therefore block none of the others, and STOP needs no lock.
"""

import multiprocessing
from typing import Any, final

import numpy as np

SPAWN = multiprocessing.get_context("spawn")


@final
class Ring:
    """The last `capacity` records of one NumPy `dtype`, appended by one process.

    Pass it to a process as it is started. A record is complete before `count` includes it, and stands unchanged until
    `capacity` more have been appended.
    """

    def __init__(self, dtype: np.dtype[Any], capacity: int) -> None:
        self.dtype = dtype
        self.capacity = capacity
        self._memory = SPAWN.RawArray("b", dtype.itemsize * capacity)
        self._count = SPAWN.RawValue("Q", 0)

    @property
    def count(self) -> int:
        """Number of records appended so far."""
        return int(self._count.value)

    def append(self, **fields: object) -> None:
        """Write one record, field by field."""
        count = self._count.value
        record = self._records()[count % self.capacity]
        for name, value in fields.items():
            record[name] = value
        self._count.value = count + 1

    def newest(self) -> Any:
        """A copy of the last record (its fields by name), None before the first."""
        count = self.count
        return self._records()[(count - 1) % self.capacity].copy() if count else None

    def since(self, count: int) -> Any:
        """Copies of the records after the first `count`, oldest first; those overwritten since are left out."""
        end = self.count
        start = max(count, end - self.capacity + 1, 0)
        return self._records()[np.arange(start, end) % self.capacity]

    def _records(self) -> Any:
        return np.frombuffer(self._memory, dtype=self.dtype)


@final
class Stamp:
    """An integer that any process may set and read at any time; 0 at first."""

    def __init__(self) -> None:
        self._value = SPAWN.RawValue("q", 0)

    @property
    def value(self) -> int:
        """The value last set."""
        return int(self._value.value)

    @value.setter
    def value(self, value: int) -> None:
        self._value.value = value
