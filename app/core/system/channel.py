"""Channels between stages. Each states its policy for a slow reader, and counts what it dropped."""

from collections import deque
from collections.abc import AsyncIterator
from typing import Generic, TypeVar, final

import anyio
from anyio.lowlevel import checkpoint

from app.core.errors import DipacError

T = TypeVar("T")


class ChannelFull(DipacError):
    """A lossless channel met its bound: its reader has stopped reading."""


@final
class Latest(Generic[T]):
    """Holder of the newest value; a value replaced before it was read is dropped and counted.

    Any number of readers: each `changes()` iterator sees every value it is quick enough for, never an old one.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.dropped = 0
        self._value: T | None = None
        self._version = 0
        self._seen = 0
        self._changed = anyio.Event()

    @property
    def value(self) -> T | None:
        """The newest value, None before the first."""
        return self._value

    def put(self, value: T) -> None:
        """Replace the value and wake every reader. Never blocks."""
        if self._seen < self._version:
            self.dropped += 1
        self._value = value
        self._version += 1
        self._changed.set()
        self._changed = anyio.Event()

    async def changes(self) -> AsyncIterator[T]:
        """The current value if there is one, then each newer one."""
        version = 0
        while True:
            while self._value is None or version == self._version:
                await self._changed.wait()
            version = self._seen = self._version
            yield self._value


@final
class Lossless(Generic[T]):
    """A bounded first-in-first-out queue that loses nothing: a sender waits while it is full.

    `peak` is the longest the queue has been. Sending and receiving are cancelled before they take effect or not at
    all, so a cancelled task neither loses nor repeats a value. The queue holds no resource that must be closed.
    """

    def __init__(self, name: str, *, bound: int) -> None:
        self.name = name
        self.bound = bound
        self.peak = 0
        self._values: deque[T] = deque()
        self._closed = False
        self._changed = anyio.Event()

    async def put(self, value: T) -> None:
        """Append, waiting for room."""
        await checkpoint()
        while len(self._values) >= self.bound:
            await self._changed.wait()
        self.put_nowait(value)

    def put_nowait(self, value: T) -> None:
        """Append from code that cannot wait.

        Raises ChannelFull where the queue is at its bound: louder than losing a message.
        """
        if self._closed:
            raise anyio.ClosedResourceError
        if len(self._values) >= self.bound:
            raise ChannelFull(f"Channel {self.name!r} is full at {self.bound}; its reader has stopped.")
        self._values.append(value)
        self.peak = max(self.peak, len(self._values))
        self._wake()

    async def get(self) -> T:
        """The oldest value, waiting for one.

        Raises anyio.EndOfStream after the last value of a closed channel.
        """
        await checkpoint()
        while not self._values:
            if self._closed:
                raise anyio.EndOfStream
            await self._changed.wait()
        return self._take()

    def get_nowait(self) -> T | None:
        """The oldest value, or None where there is none."""
        return self._take() if self._values else None

    def close(self) -> None:
        """End the stream; readers end after the last value."""
        self._closed = True
        self._wake()

    async def __aiter__(self) -> AsyncIterator[T]:
        while True:
            try:
                value = await self.get()
            except anyio.EndOfStream:
                return
            yield value

    def _take(self) -> T:
        value = self._values.popleft()
        self._wake()
        return value

    def _wake(self) -> None:
        self._changed.set()
        self._changed = anyio.Event()
