"""Store of the session's state: events change it by the rules, and what waits for it, or depends on it, is told."""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import final

import anyio

from app.core.announcer import MessageBus
from app.core.dialogue.checklist import Checklist
from app.core.dialogue.control import Mode
from app.core.messages import MessageId, fresh_id
from app.core.ports import Clock
from app.session.rules import reduce
from app.session.state import Announce, AnnounceChecklist, AnnounceMode, AnnounceModel, Command, Event, SessionState


@final
class SessionStore:
    """Holder of the state. `mode`: the mode as last published; `mode_over`: set once it is another."""

    def __init__(self, state: SessionState, announcer: MessageBus, clock: Clock) -> None:
        self.state = state
        self._announcer, self._clock = announcer, clock
        self._changed, self.mode_over = anyio.Event(), anyio.Event()
        self._scopes = list[tuple[anyio.CancelScope, Callable[[SessionState], bool]]]()
        self.mode = self._mode(())

    def dispatch(self, event: Event) -> SessionState:
        """Change the state, give up what it does not allow any more, and publish what follows; returns the state."""
        before = self.state
        self.state, commands = reduce(before, event)
        for scope, allows in self._scopes:
            if not allows(self.state):
                scope.cancel()
        if self.state.mode_changes != before.mode_changes:
            self.mode_over.set()
            self.mode_over = anyio.Event()
        self._changed.set()
        self._changed = anyio.Event()
        for command in commands:
            self._execute(command)
        return self.state

    async def until(self, holds: Callable[[SessionState], bool]) -> None:
        """Wait until it `holds`."""
        while not holds(self.state):
            await self._changed.wait()

    @contextmanager
    def until_interrupted(self, at_most_s: float | None = None) -> Generator[anyio.CancelScope]:
        """Cancel scope that ends when plans become void, or after so long."""
        asked = self.state.interruptions
        with self._while(lambda state: state.interruptions == asked, at_most_s) as scope:
            yield scope

    @contextmanager
    def in_this_mode(self) -> Generator[anyio.CancelScope]:
        """Cancel scope that ends with the mode."""
        changes = self.state.mode_changes
        with self._while(lambda state: state.mode_changes == changes) as scope:
            yield scope

    @contextmanager
    def _while(
        self, allows: Callable[[SessionState], bool], at_most_s: float | None = None
    ) -> Generator[anyio.CancelScope]:
        with self._clock.move_on_after(at_most_s) as scope:
            self._scopes.append((scope, allows))
            try:
                yield scope
            finally:
                self._scopes.remove((scope, allows))

    def _execute(self, command: Command) -> None:
        match command:
            case Announce():
                self._announcer.notice(command.where, command.text, *command.about)
            case AnnounceMode():
                self.mode = self._announcer.say(self._mode(command.cause))
            case AnnounceModel():
                self._announcer.say(self.state.model_in_use)
            case AnnounceChecklist():
                self._announcer.say(self._checklist())

    def _mode(self, cause: tuple[MessageId, ...]) -> Mode:
        state, now_s = self.state, self._clock.now()
        return Mode(
            id=fresh_id("mode"), cause=cause, time_s=now_s, mode=state.mode, motions=state.motions, why=state.why
        )

    def _checklist(self) -> Checklist:
        state, now_s = self.state, self._clock.now()
        return Checklist(
            id=fresh_id("checklist"), time_s=now_s, items=state.items, passed=state.passed, by_hand=state.by_hand
        )
