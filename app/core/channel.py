"""Channels between stages. Each says what it does when its reader is slow, and counts what it dropped."""

from collections.abc import AsyncIterator
from typing import Generic, TypeVar, final

import anyio
from anyio.streams.memory import MemoryObjectReceiveStream, MemoryObjectSendStream

from app.core.errors import DipacError

T = TypeVar("T")


class ChannelFull(DipacError):
    """A lossless channel met its bound: its reader has stopped reading."""


@final
class Latest(Generic[T]):
    """Holds the newest value; a value that nobody read before the next one came is dropped and counted.

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

    `peak` is the longest the queue has been.
    """

    def __init__(self, name: str, *, bound: int) -> None:
        self.name = name
        self.bound = bound
        self.peak = 0
        self._send: MemoryObjectSendStream[T]
        self._receive: MemoryObjectReceiveStream[T]
        self._send, self._receive = anyio.create_memory_object_stream[T](bound)

    async def put(self, value: T) -> None:
        """Append, waiting for room."""
        await self._send.send(value)
        self._note_length()

    def put_nowait(self, value: T) -> None:
        """Append from code that cannot wait.

        Raises ChannelFull where the queue is at its bound: louder than losing a message.
        """
        try:
            self._send.send_nowait(value)
        except anyio.WouldBlock:
            raise ChannelFull(f"Channel {self.name!r} is full at {self.bound}; its reader has stopped.") from None
        self._note_length()

    async def get(self) -> T:
        """The oldest value, waiting for one."""
        return await self._receive.receive()

    def get_nowait(self) -> T | None:
        """The oldest value, or None where there is none."""
        try:
            return self._receive.receive_nowait()
        except anyio.WouldBlock:
            return None

    def close(self) -> None:
        """No more values will come; readers end after the last one."""
        self._send.close()

    async def __aiter__(self) -> AsyncIterator[T]:
        async for value in self._receive:
            yield value

    def _note_length(self) -> None:
        self.peak = max(self.peak, self._send.statistics().current_buffer_used)
