"""Operators that an episode is shown to, and asked by."""

from collections.abc import AsyncIterator
from typing import final

from app.core.dialogue.requests import Request
from app.core.messages import Message
from app.ui.console import Console
from app.ui.terminal import Terminal


@final
class Audience:
    """The console in the browser and the terminal as one operator; only the console asks for things."""

    def __init__(self, console: Console, terminal: Terminal) -> None:
        self._console = console
        self._terminal = terminal

    def show(self, message: Message) -> None:
        """Show it on both."""
        self._console.show(message)
        self._terminal.show(message)

    def requests(self) -> AsyncIterator[Request]:
        """Requests of the console."""
        return self._console.requests()
