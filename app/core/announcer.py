"""Message publication: every message goes to the operator and into the log, in one order."""

from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from typing import TypeVar, final

import anyio

from app.core.dialogue.summary import Summary
from app.core.errors import DipacError, first_error
from app.core.messages import Fault, Message, MessageId, Notice, fresh_id
from app.core.ports import Clock, Operator, Recorder
from app.core.system.channel import Lossless

MessageT = TypeVar("MessageT", bound=Message)

_BOUND = 500
"""Messages waiting for the recorder; with images about 500 MB, or half a minute of a stalled disk."""


@final
class MessageBus:
    """Shows messages to `operator`, hands them to `recorder`, and counts them and the faults in `summary`."""

    def __init__(self, *, operator: Operator, recorder: Recorder, clock: Clock, summary: Summary) -> None:
        self._operator = operator
        self._recorder = recorder
        self._clock = clock
        self._summary = summary
        self._log = Lossless[Message]("log", bound=_BOUND)
        self._said = self._recorded = 0
        self._recorded_one = anyio.Event()

    def say(self, message: MessageT) -> MessageT:
        """Show the message to the operator and queue it for the log; returns it."""
        self._operator.show(message)
        self._log.put_nowait(message)
        self._said += 1
        self._summary.said += 1
        return message

    def notice(self, where: str, text: str, *about: MessageId) -> None:
        """Publish a notice for the operator. A proposal among `about` is withdrawn by it."""
        self.say(Notice(id=fresh_id("notice"), cause=about, time_s=self._clock.now(), where=where, text=text))

    def fault(self, where: str, error: DipacError) -> None:
        """Publish a fault that did not end the episode."""
        self._summary.faults.append(f"{where}: {error}")
        self.say(Fault(id=fresh_id("fault"), time_s=self._clock.now(), where=where, text=str(error)))

    def end(self, error: BaseException) -> None:
        """Publish the fatal fault that ended the episode, as its last message."""
        self.say(Fault(id=fresh_id("fault"), time_s=self._clock.now(), where="episode", text=str(error), fatal=True))

    @asynccontextmanager
    async def recording(self) -> AsyncGenerator[None]:
        """Record every published message until the last one is with the recorder, whatever ends the block.

        Raises what ends the block or the recording, by itself and not in a group.
        """
        try:
            async with anyio.create_task_group() as group:
                group.start_soon(self._record)
                try:
                    yield
                finally:
                    self._log.close()
        except BaseExceptionGroup as errors:
            raise first_error(errors) from errors

    async def flush(self) -> None:
        """Wait until the recorder has everything published so far."""
        said = self._said
        while self._recorded < said:
            await self._recorded_one.wait()

    async def room(self) -> None:
        """Wait until the log is at most half full: backpressure for producers without a bound of their own."""
        while self._said - self._recorded > _BOUND // 2:
            await self._recorded_one.wait()

    async def _record(self) -> None:
        with anyio.CancelScope(shield=True):
            async for message in self._log:
                await self._recorder.write(message)
                self._recorded += 1
                self._recorded_one.set()
                self._recorded_one = anyio.Event()
