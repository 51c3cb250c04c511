"""The weighed causes with probability and size, and the confusions among them for these pushes."""

import math

import numpy as np

from app.core.dialogue.words import probability
from app.discovery.dataset.names import effect_name, motion_name
from app.discovery.results.case import Case, CauseResult
from app.report.drawing.chart import label, svg
from app.report.drawing.layout import details, figure, paragraph, table
from app.report.drawing.markup import Markup, concat, tag
from app.report.drawing.size import size
from app.report.drawing.words import best, decimal, interval, title

_FIRST = 8
"""Causes shown at once; the others on demand."""
_CONFUSED_FROM, _CONFUSED_LEAST = 0.3, 0.03
"""Share of the cases in which one is taken for itself from which it is taken for another one often; and the least."""
_SEEN = 0.5
"""Share of the cases in which something is found below which a cause mostly stays unseen."""
_NUMBERED_FROM = 0.01
_LABELS = 190.0
_NARROW = 24.0
"""Cell size below which cells hold no numbers, and the names above them stand upright."""


def causes(case: Case) -> Markup:
    """The ranking as a table, the verdict's causes first."""
    chosen = {blame.effect for blame in case.causes}
    rest = sorted((it for it in case.ranking if it.effect not in chosen), key=lambda it: -it.probability)
    ordered = [*case.causes, *rest]
    if not ordered:
        return paragraph(f"No cause was weighed: there are too few {motion_name(case.kind, count=2)}.")
    first, others = ordered[:_FIRST], ordered[_FIRST:]
    shown = _table(first, chosen)
    return concat([shown, details(f"{len(others)} less likely causes", _table(others, chosen))]) if others else shown


def _table(blames: list[CauseResult], chosen: set[str]) -> Markup:
    heads = ("Cause", "Probability", "", "Size", "90 % interval", "log Bayes factor")
    rows = [_row(blame, blame.effect in chosen) for blame in blames]
    return table(heads, rows, numbers=(1, 3, 4, 5), kind="causes")


def _row(blame: CauseResult, chosen: bool) -> tuple[Markup, str, Markup, str, str, str]:
    whole = size(blame)
    numbers = (whole.value, whole.low, whole.high, whole.unit)
    name = concat(
        [
            tag("b", title(blame.effect), class_="chosen" if chosen else None),
            tag("small", f"{blame.family} \N{MIDDLE DOT} {_about(blame)}"),
        ]
    )
    return (
        name,
        probability(blame.probability),
        _bar(blame.probability, "extended" if chosen else "still"),
        best(*numbers),
        interval(*numbers),
        decimal(blame.log_bayes, 1),
    )


def _about(blame: CauseResult) -> str:
    """Description of the cause, without its name where that comes first."""
    name, colon, rest = blame.about.partition(": ")
    return rest if colon and len(name) < 80 else blame.about


def _bar(share: float, kind: str, width: float = 110.0) -> Markup:
    """A probability as a small bar."""
    filled = min(max(share, 0.0), 1.0) if math.isfinite(share) else 0.0
    full = tag("rect", x=0.0, y=4.0, width=width, height=9.0, rx=2.0, class_="trough")
    part = tag("rect", x=0.0, y=4.0, width=max(width * filled, 1.5), height=9.0, rx=2.0, class_=f"fill {kind}")
    return svg(width, 17.0, f"Probability {probability(share)}", "As a bar of 0 to 100 %.", full, part)


def confusions(case: Case) -> Markup:
    """Heat map of the share in which each hidden cause would have been taken for each."""
    count = len(case.confused)
    if not count:
        return paragraph("The test was not tried on hidden causes, so nobody knows what it would confuse.")
    cell = min(46.0, 560.0 / count)
    top, width = 148.0, _LABELS + cell * count + 90
    names, motions = [effect_name(effect) for effect in case.confused], motion_name(case.kind, count=2)
    drawing = svg(
        width,
        top + cell * count + 8,
        f"Which causes these {motions} would confuse",
        f"Rows: what was hidden; columns: what it was taken for. {_confusion_text(case)}",
        label(_LABELS - 12, top - 10, "hidden \N{DOWNWARDS ARROW}", "strong", anchor="end"),
        label(_LABELS - 12, top - 32, "taken for, in % \N{RIGHTWARDS ARROW}", "strong", anchor="end"),
        *(label(_LABELS - 12, top + cell * (k + 0.5) + 4, name, "tick", anchor="end") for k, name in enumerate(names)),
        *(
            _column_name(_LABELS + cell * (k + 0.5), top - 8, name, slanted=cell > _NARROW)
            for k, name in enumerate(names)
        ),
        *(
            _cell(_LABELS + cell * j, top + cell * i, cell, float(case.confusions[i, j]), i == j)
            for i in range(count)
            for j in range(count)
        ),
    )
    return figure(
        drawing,
        f"Each cause was hidden in these very {motions} at its typical size, and looked for, by their slopes about the "
        "nominal model: a dark diagonal means that it would be named, a light row that it would stay unseen. "
        f"{_confusion_text(case)}",
    )


def _column_name(x: float, y: float, name: str, *, slanted: bool) -> Markup:
    turn = -42 if slanted else -90
    return tag("text", name, x=x + 4, y=y, class_="tick", transform=f"rotate({turn} {x + 4:.1f} {y:.1f})")


def _cell(x: float, y: float, side: float, share: float, own: bool) -> Markup:
    known = share if math.isfinite(share) else 0.0
    box = tag(
        "rect", x=x + 1, y=y + 1, width=side - 2, height=side - 2, rx=3.0, class_="trough own" if own else "trough"
    )
    heat = tag("rect", x=x + 1, y=y + 1, width=side - 2, height=side - 2, rx=3.0, class_="heat", opacity=f"{known:.2f}")
    if known < _NUMBERED_FROM or side < _NARROW:
        return concat([box, heat])
    kind = "cell on" if known > 0.7 else "cell"
    return concat([box, heat, label(x + side / 2, y + side / 2 + 4, f"{100 * known:.0f}", kind, anchor="middle")])


def _confusion_text(case: Case) -> str:
    """The causes that would mostly stay unseen, and the pairs that are taken for one another, in words."""
    found = case.confusions.sum(axis=1)
    unseen = [effect_name(name) for name, share in zip(case.confused, found, strict=True) if share < _SEEN]
    words = f"Mostly unseen at that size: {', '.join(unseen)}. " if unseen else ""
    mutual, own = np.maximum(case.confusions, case.confusions.T), case.confusions.diagonal()
    pairs = sorted(
        (
            (float(mutual[i, j]), i, j)
            for i in range(len(mutual))
            for j in range(i)
            if mutual[i, j] >= max(_CONFUSED_LEAST, _CONFUSED_FROM * max(own[i], own[j]))
        ),
        reverse=True,
    )
    if not pairs:
        return f"{words}No two of them are often taken for one another."
    said = [
        f"{effect_name(case.confused[j])} and {effect_name(case.confused[i])} ({probability(share)})"
        for share, i, j in pairs[:4]
    ]
    return f"{words}Hard to tell apart: {'; '.join(said)}."
