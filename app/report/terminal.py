"""The verdict in a terminal of 80 columns.

Text of the case is printed as Text: as a string, rich would read its brackets as markup.
"""

from pathlib import Path

from rich import box
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from app.core.dialogue.words import probability
from app.discovery.dataset.names import motion_name
from app.discovery.results.case import Case, CauseResult
from app.report.drawing.size import size
from app.report.drawing.words import best, interval, title
from app.report.sections.advice import MODEL, advice
from app.report.sections.verdict import chance, gain_sentence, headline, kind, unit_of

_WIDTH = 80
_ALTERNATIVES = 4
"""Causes shown below those that the verdict names."""
_STYLES = {"named": "green", "set": "yellow", "none": "green", "none_of_these": "yellow"}


def show_case(case: Case, report: Path | None = None) -> RenderableType:
    """The verdict, its causes, their gain, the next push, and the path of the report."""
    parts: list[RenderableType] = [_panel(case)]
    steps = advice(case, MODEL if report is None else report.with_name(MODEL.name))
    if case.setup is not None:
        words = (text.split(": ", 1) for text in case.setup.words)
        parts += [_line(label, f"{text[0].upper()}{text[1:]}") for label, text in words]
    if case.ranking or case.causes:
        parts.append(_causes(case))
    parts += [
        _line("Gain", gain_sentence(case.gain, unit_of(case))),
        *(_line("Limit", f"{it.text} {it.consequence}") for it in case.limits),
    ]
    if case.formula is not None:
        parts.append(_line("Formula", f"{case.formula.text}: {case.formula.words}"))
    parts += [_line("Next", text) for text in steps]
    if case.next_push is not None and case.next_push.text not in " ".join(steps):
        parts.append(_line(f"Next {motion_name(case.kind)}", case.next_push.text))
    if report is not None:
        parts.append(Text.assemble((f"{'Report':<11}", "bold"), str(report), no_wrap=True, overflow="ignore"))
    return Group(*parts)


def _panel(case: Case) -> Panel:
    said = Text(headline(case), style="bold")
    known = chance(case)
    if known is not None:
        said.append(f"\n{known[0]} {known[1]}", style="not bold dim")
    said.append("\n")
    for text in case.sentences:
        said.append(f"\n{text}", style="not bold")
    return Panel(said, title=kind(case), title_align="left", border_style=_STYLES[case.verdict], width=_WIDTH)


def _causes(case: Case) -> Table:
    table = Table(box=box.SIMPLE_HEAD, width=_WIDTH, pad_edge=False)
    table.add_column("Cause", ratio=1)
    for column in ("Size", "90 % interval", "Probability"):
        table.add_column(column, justify="right")
    named = {blame.effect for blame in case.causes}
    others = sorted((it for it in case.ranking if it.effect not in named), key=lambda it: -it.probability)
    for blame in case.causes:
        table.add_row(*_row(blame), style="bold")
    for blame in others[:_ALTERNATIVES]:
        table.add_row(*_row(blame), style="dim")
    return table


def _row(blame: CauseResult) -> tuple[Text, Text, Text, Text]:
    whole = size(blame)
    numbers = (whole.value, whole.low, whole.high, whole.unit)
    return (
        Text(title(blame.effect)),
        Text(best(*numbers), no_wrap=True),
        Text(interval(*numbers), no_wrap=True),
        Text(probability(blame.probability)),
    )


def _line(label: str, text: str) -> RenderableType:
    grid = Table.grid(padding=(0, 1, 0, 0))
    grid.add_column(width=10, style="bold")
    grid.add_column(ratio=1)
    grid.add_row(label, Text(text))
    grid.width = _WIDTH
    return Padding(grid, 0)
