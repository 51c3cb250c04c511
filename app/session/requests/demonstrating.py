"""Demonstrations: their files, their verdicts, and how many there are."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal, final

from app.core.announcer import MessageBus
from app.core.dialogue.demonstration_messages import Take, TakeState
from app.core.dialogue.requests import ClipRequest, TakeRequest
from app.core.errors import DipacError
from app.core.messages import Message, Transition, fresh_id
from app.core.ports import Clock, Studio


@final
class Demonstrating:
    """Recorder of demonstrations on request; it publishes a `Take` each time, or the reason without `studio`."""

    def __init__(self, studio: Studio | None, announcer: MessageBus, clock: Clock) -> None:
        self._announcer, self._clock, self._studio = announcer, clock, studio
        self._number = self._succeeded = self._transitions = 0
        self._path: Path | None = None

    async def handle(self, request: TakeRequest, opening: Callable[[], Sequence[Message]]) -> None:
        """Execute a request; `opening`: the first messages of a new file."""
        studio = self._studio
        if studio is None:
            self._announcer.notice("demonstration", "This session is not recorded; no demonstration can be.")
            return
        try:
            match request.act:
                case "start":
                    await self._begin(studio, opening)
                case "success" | "failure":
                    await self._end(studio, request.act, request.operator)
                case "discard":
                    await self._end(studio, None, request.operator)
                case "redo":
                    await self._end(studio, None, request.operator)
                    await self._begin(studio, opening)
        except DipacError as error:
            self._announcer.fault("demonstration", error)

    async def clip(self, request: ClipRequest) -> None:
        """Keep what was just recorded."""
        if self._studio is None:
            self._announcer.notice("clip", "This session is not recorded; there is nothing to keep.")
            return
        await self._announcer.flush()
        try:
            path = await self._studio.clip(request.duration_s)
        except DipacError as error:
            self._announcer.fault("clip", error)
        else:
            self._announcer.notice("clip", f"The last {request.duration_s:.0f} s are kept in {path}.", request.id)

    def count(self, transition: Transition) -> None:
        """Count what was demonstrated."""
        if self._path is not None:
            self._transitions += 1
            self._say("recording", transition, path=self._path)

    async def _begin(self, studio: Studio, opening: Callable[[], Sequence[Message]]) -> None:
        if self._path is not None:
            self._announcer.notice("demonstration", f"Demonstration {self._number} is being recorded; end it first.")
            return
        await self._announcer.flush()
        self._path = await studio.begin(opening)
        self._number, self._transitions = self._number + 1, 0
        self._say("recording", path=self._path)

    async def _end(self, studio: Studio, said: Literal["success", "failure"] | None, operator: str) -> None:
        if self._path is None:
            self._announcer.notice("demonstration", "None is being recorded; start one first.")
            return
        if said is not None and not self._transitions:
            text = "Nothing was moved in it yet: move the object by hand and let the arm rest, or discard it."
            self._announcer.notice("demonstration", text)
            return
        path, self._path = self._path, None
        await self._announcer.flush()
        await studio.end(said, operator=operator)
        self._succeeded += said == "success"
        self._say(said or "discarded", path=path)

    def _say(self, state: TakeState, *about: Message, path: Path) -> None:
        self._announcer.say(
            Take(
                id=fresh_id("take"),
                cause=tuple(message.id for message in about),
                time_s=self._clock.now(),
                number=self._number,
                path=str(path),
                state=state,
                transitions=self._transitions,
                succeeded=self._succeeded,
            )
        )
