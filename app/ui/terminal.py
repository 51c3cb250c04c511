"""The episode as lines in a terminal: the current stage, a line a push, notices and faults.

Text of messages is printed as Text: as a string, rich would read its brackets as markup and raise on invalid ones.

A thread of its own prints: a halted terminal (Ctrl-S) or a pipe without a reader may block it for any time, and the
program's loop must go on meanwhile.
"""

import math
import threading
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager, nullcontext, suppress
from queue import SimpleQueue
from typing import Any, Final, final

import anyio
from anyio import to_thread
from rich.console import Console
from rich.text import Text

from app.core.dialogue.words import NOTHING, millimetres
from app.core.messages import Fault, Health, Message, Notice, Outcome
from app.core.system.standard_streams import silence

HEADER = "push   distance to goal  predicted  cost, descent [1e-3]     plan  model"
"""Each title ends where its column does in `outcome_line`; both fit 80 characters."""

LINES_BOUND: Final = 200
"""Capacity of the queue for a blocked terminal."""

_CLOSING_S: Final = 1.0
"""Time limit [s] of leaving while a terminal is blocked."""


@final
class Output(Console):
    """A terminal, a file or a pipe; one that takes nothing any more ends the printing, never the program.

    That is a pipe whose reader has left (`| head`), a terminal that was hung up, or a full disk: the console in the
    browser shows everything.
    """

    def on_broken_pipe(self) -> None:
        """Print nothing more."""
        with suppress(SystemExit):  # rich silences itself, and then would exit
            super().on_broken_pipe()

    def print(self, *objects: Any, **layout: Any) -> None:
        """Print the objects, as rich does."""
        try:
            super().print(*objects, **layout)
        except OSError:
            self.quiet = True
            silence(self.file)


@asynccontextmanager
async def open_terminal(output: Output, *heading: Text) -> AsyncGenerator["Terminal"]:
    """A terminal that prints `heading` and the messages shown to it; a line with `no_wrap` stays one line.

    Leaving waits a second for pending lines. Where the output accepts them later, the process ends after that.
    """
    terminal = Terminal(output, *heading)
    terminal.start()
    try:
        yield terminal
    finally:
        with anyio.CancelScope(shield=True):
            await to_thread.run_sync(terminal.close)


@final
class Terminal:
    """Prints the messages for an operator without a browser. On a terminal the last line shows the stage and its age.

    `left_out` counts the lines dropped from a full queue.
    """

    def __init__(self, output: Output, *heading: Text) -> None:
        self.left_out = 0
        self._output = output
        self._status = output.status("starting") if output.is_terminal else None
        self._stage = ""
        self._lines: SimpleQueue[Text | None] = SimpleQueue()
        for line in (*heading, Text(HEADER, "bold")):
            self._lines.put(line)
        self._thread = threading.Thread(target=self._print_all, name="terminal")

    def start(self) -> None:
        """Start printing."""
        self._thread.start()

    def close(self) -> None:
        """Print pending lines, for a second at most."""
        self._lines.put(None)
        self._thread.join(_CLOSING_S)

    def show(self, message: Message) -> None:
        """Print the message where it belongs in the terminal. Never blocks."""
        match message:
            case Health():
                self._show_stage(message.doing)
            case Outcome():
                self._enqueue(Text(outcome_line(message)))
            case Notice():
                self._enqueue(Text.assemble((message.where, "cyan"), f": {message.text}"))
            case Fault():
                self._enqueue(Text.assemble((f"fault, {message.where}", "red"), f": {message.text}"))
            case _:
                pass

    def _show_stage(self, doing: str) -> None:
        """Update the status line; where the output is a file, print each compilation once instead."""
        if self._status is not None:
            self._status.update(Text(doing))
            return
        stage = doing.rsplit(" (", 1)[0]
        if stage != self._stage and stage.startswith("compiling"):
            self._enqueue(Text(f"{stage} ..."))
        self._stage = stage

    def _enqueue(self, line: Text) -> None:
        if self._lines.qsize() < LINES_BOUND:
            self._lines.put(line)
        else:
            self.left_out += 1

    def _print_all(self) -> None:
        """The printing thread: line after line until the end mark."""
        with self._status or nullcontext():
            for line in iter(self._lines.get, None):
                self._output.print(line, soft_wrap=bool(line.no_wrap))
            if self.left_out:
                self._output.print(Text(f"{self.left_out} lines were left out: the terminal took none."))


def outcome_line(outcome: Outcome) -> str:
    """One push as a line; distances as the root of half the Chamfer distance, in millimetres."""
    chamfers_m2 = (outcome.chamfer_before_m2, outcome.chamfer_after_m2, outcome.predicted_chamfer_m2)
    before, after, predicted = map(millimetres, chamfers_m2)
    costs = f"{1e3 * outcome.cost_before:8.2f} -> {1e3 * outcome.cost_after:7.2f}"
    if math.isnan(outcome.cost_after):  # A requested push has none.
        costs = f"{NOTHING:>8}    {NOTHING:>7}"
    return (
        f"{outcome.index:4d}  {before:5.1f} -> {after:5.1f} mm  {predicted:6.1f} mm   "
        f"{costs}  {outcome.plan_s:5.1f} s  "
        f"v{outcome.model_version}"
    )
