"""The episode as lines in a terminal: what is being done now, a line a push, notices and faults.

What messages say is printed as Text: as a string, rich would read its brackets as markup and raise where they are not.
"""

from types import TracebackType
from typing import Self, final

from rich.console import Console
from rich.status import Status
from rich.text import Text

from app.core.messages import Fault, Health, Message, Notice, Outcome
from app.ui.words import millimetres

_HEADER = "push   distance to goal  predicted  cost, descent [1e-3]     plan  model"
"""Each title ends where its column does in `outcome_line`; both fit 80 characters."""


@final
class Terminal:
    """Prints what an operator without a browser needs. On a terminal the last line shows the stage and its age."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._status: Status | None = None
        self._stage = ""

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._status = self._console.status("starting")
            self._status.start()
        self._print_header()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if self._status is not None:
            self._status.stop()

    def show(self, message: Message) -> None:
        """Print the message where it is one that belongs here."""
        match message:
            case Health():
                self._show_stage(message.mode)
            case Outcome():
                self._console.print(Text(outcome_line(message)))
            case Notice():
                self._console.print(Text.assemble((message.where, "cyan"), f": {message.text}"))
            case Fault():
                self._console.print(Text.assemble((f"fault, {message.where}", "red"), f": {message.text}"))
            case _:
                pass

    def _show_stage(self, mode: str) -> None:
        """Update the status line; where the output is a file, print each compilation once instead."""
        if self._status is not None:
            self._status.update(Text(mode))
            return
        stage = mode.rsplit(" (", 1)[0]
        if stage != self._stage and stage.startswith("compiling"):
            self._console.print(Text(f"{stage} ..."))
        self._stage = stage

    def _print_header(self) -> None:
        self._console.print(Text(_HEADER, "bold"))


def outcome_line(outcome: Outcome) -> str:
    """One push as a line; distances as the root of half the Chamfer distance, in millimetres."""
    chamfers_m2 = (outcome.chamfer_before_m2, outcome.chamfer_after_m2, outcome.predicted_chamfer_m2)
    before, after, predicted = map(millimetres, chamfers_m2)
    return (
        f"{outcome.index:4d}  {before:5.1f} -> {after:5.1f} mm  {predicted:6.1f} mm   "
        f"{1e3 * outcome.cost_before:8.2f} -> {1e3 * outcome.cost_after:7.2f}  {outcome.plan_s:5.1f} s  "
        f"v{outcome.model_version}"
    )
