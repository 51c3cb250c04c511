"""Test of the frame in which the mean residual is constant, as bars with intervals."""

import math

from app.core.dialogue.words import sentence
from app.discovery.results.case import Case, FrameTest
from app.report.drawing.chart import Axis, label, line, svg
from app.report.drawing.layout import paragraph, table
from app.report.drawing.markup import Markup, concat, tag
from app.report.drawing.words import decimal, percent

_WIDTH, _HEIGHT = 380.0, 26.0
_SHARE = Axis(low=0.0, high=1.0, start=10.0, end=_WIDTH - 24)


def frames(case: Case) -> Markup:
    """A bar for each frame, the one that explains most first."""
    ordered = sorted((it for it in case.frames if math.isfinite(it.explained)), key=lambda it: -it.explained)
    if not ordered:
        return paragraph("There is nothing to test: no residuals were measured.")
    rows = [_row(it, first=index == 0) for index, it in enumerate(ordered)]
    heads = ("Frame", "Constant in it", "Share of the mean residual's variance, with 90 % interval")
    return concat(
        [
            paragraph(_conclusion(ordered), "lead"),
            table(heads, [*rows, ("", "", _scale())], numbers=(1,), kind="frames"),
        ]
    )


def _row(it: FrameTest, *, first: bool) -> tuple[Markup, str, Markup]:
    name = concat([tag("b", sentence(it.frame), class_="chosen" if first else None), tag("small", it.about)])
    return name, percent(it.explained), _bar(it, "extended" if first else "still")


def _bar(it: FrameTest, kind: str) -> Markup:
    middle = _HEIGHT / 2
    low, high = (
        _SHARE(min(max(end, 0.0), 1.0)) if math.isfinite(end) else _SHARE(it.explained) for end in (it.low, it.high)
    )
    return svg(
        _WIDTH,
        _HEIGHT,
        f"{sentence(it.frame)}: {percent(it.explained)}",
        f"A bar, and an interval from {decimal(100 * it.low, 0)} to {decimal(100 * it.high, 0)} %.",
        *(line((_SHARE(share), 0.0), (_SHARE(share), _HEIGHT), "grid") for share in (0.0, 0.25, 0.5, 0.75, 1.0)),
        tag(
            "rect",
            x=_SHARE.start,
            y=middle - 8,
            width=_SHARE(it.explained) - _SHARE.start,
            height=16.0,
            class_=f"fill {kind}",
        ),
        line((low, middle), (high, middle), "whisker"),
        *(line((end, middle - 4), (end, middle + 4), "whisker") for end in (low, high)),
    )


def _scale() -> Markup:
    """The bars' common axis, below them."""
    shares = (0.0, 0.25, 0.5, 0.75, 1.0)
    numbers = (label(_SHARE(share), 14.0, f"{100 * share:.0f} %", "tick", anchor="middle") for share in shares)
    return svg(_WIDTH, 18.0, "Axis", "From 0 to 100 %.", *numbers)


def _conclusion(ordered: list[FrameTest]) -> str:
    first = ordered[0]
    rivals = [it.frame for it in ordered[1:] if it.high >= first.low]
    named = f"\N{LEFT DOUBLE QUOTATION MARK}{first.frame}\N{RIGHT DOUBLE QUOTATION MARK}"
    if rivals:
        others = ", ".join(rivals)
        return f"The frame {named} explains most, but not clearly more than {others}: their intervals overlap."
    return f"The residual is constant in {named} more than in any other frame. An error has the frame of its cause."
