"""Detectability in these data: the smallest visible size of each cause against a typical one."""

import math

from app.discovery.dataset.names import effect_name
from app.discovery.results.case import Case, Power
from app.report.drawing.chart import Axis, arrow_path, label, line, svg
from app.report.drawing.layout import details, figure, paragraph, table
from app.report.drawing.markup import Markup, concat, tag
from app.report.drawing.words import decimal, of, quantity, title

_ROW, _WIDTH, _LABELS, _NUMBERS = 26.0, 780.0, 220.0, 170.0
_LOW, _HIGH = 0.1, 10.0
"""Ends of the axis, in typical sizes."""
_DRAWN = 18
_TOLD = 5
"""Most rows of the figure, and causes named in its caption."""


def powers(case: Case) -> Markup:
    """Detectability in words, as a figure of the worst parameter of each cause, and all numbers on demand."""
    if not case.powers:
        return paragraph("What these data would have shown was not computed.")
    worst = _worst(case.powers)
    drawn = worst[:_DRAWN]
    all_numbers = table(
        ("Cause", "Parameter", "Smallest visible", "Typical"),
        [
            (title(it.effect), effect_name(it.parameter), _least(it), quantity(it.typical, it.unit))
            for it in case.powers
        ],
        numbers=(2, 3),
    )
    return concat([_figure(drawn, worst), details(f"All {len(case.powers)} parameters", all_numbers)])


def _worst(given: tuple[Power, ...]) -> list[Power]:
    """The least visible parameter of each cause, the least visible first."""
    by_effect = dict[str, Power]()
    for it in given:
        if it.effect not in by_effect or ratio(it) > ratio(by_effect[it.effect]):
            by_effect[it.effect] = it
    return sorted(by_effect.values(), key=lambda it: -ratio(it))


def ratio(it: Power) -> float:
    """The smallest visible size in typical ones; infinite where nothing is visible or typical."""
    share = abs(it.least / it.typical) if it.typical else math.inf
    return share if math.isfinite(share) else math.inf


def _least(it: Power) -> str:
    return quantity(it.least, it.unit) if math.isfinite(it.least) else "never"


def _figure(drawn: list[Power], worst: list[Power]) -> Markup:
    x = Axis(low=math.log10(_LOW), high=math.log10(_HIGH), start=_LABELS, end=_WIDTH - _NUMBERS)
    bottom = 24 + _ROW * len(drawn)
    ticks = [(0.1, "0.1"), (0.2, "0.2"), (0.5, "0.5"), (1.0, "typical size"), (2.0, "2"), (5.0, "5"), (10.0, "10")]
    drawing = svg(
        _WIDTH,
        bottom + 44,
        "Smallest visible size of each cause",
        sentence_of(worst),
        tag("rect", x=x(0.0), y=22.0, width=x.end - x(0.0), height=bottom - 22, class_="unseen"),
        label(x(0.0) - 8, 14.0, "visible when typical", "small", anchor="end"),
        label(x(0.0) + 8, 14.0, "invisible when typical", "small"),
        *(line((x(math.log10(v)), 22.0), (x(math.log10(v)), bottom), "axis" if v == 1 else "grid") for v, _ in ticks),
        *(label(x(math.log10(v)), bottom + 17, text, "tick", anchor="middle") for v, text in ticks),
        label((x.start + x.end) / 2, bottom + 36, "smallest visible size, in typical sizes", "name", anchor="middle"),
        *(_row(x, it, 24 + _ROW * (index + 0.5)) for index, it in enumerate(drawn)),
    )
    left = (
        f" The {len(worst) - len(drawn)} causes not drawn are easier to see than these."
        if len(worst) > len(drawn)
        else ""
    )
    return figure(drawing, sentence_of(worst) + left)


def _row(x: Axis, it: Power, y: float) -> Markup:
    share = ratio(it)
    name = label(_LABELS - 12, y + 4, effect_name(it.effect), "tick", anchor="end")
    text = of(it.least, it.typical, it.unit) if math.isfinite(it.least) else "at no size"
    number = label(_WIDTH - _NUMBERS + 14, y + 4, text, "tick")
    kind = "unsound" if share > 1 else "sound"
    if share > _HIGH:
        return concat(
            [name, number, tag("path", d=arrow_path((x.end - 26, y), (x.end - 2, y), 7.0), class_=f"beyond {kind}")]
        )
    at = x(math.log10(max(share, _LOW)))
    return concat(
        [
            name,
            number,
            line((x.start, y), (at, y), f"stem {kind}"),
            tag("circle", cx=at, cy=y, r=5.0, class_=f"value {kind}"),
        ]
    )


def sentence_of(worst: list[Power]) -> str:
    """Sentences on the causes that would be invisible."""
    never = [effect_name(it.effect) for it in worst if math.isinf(ratio(it))]
    weak = [
        f"{effect_name(it.effect)} (from {decimal(ratio(it), 1)} times typical)"
        for it in worst
        if 1 < ratio(it) < math.inf
    ]
    more = f" and {len(weak) - _TOLD} others" if len(weak) > _TOLD else ""
    seen = sum(ratio(it) <= 1 for it in worst)
    parts = [f"At its typical size, {seen} of {len(worst)} causes would have been seen."]
    parts += [f"Only when larger: {', '.join(weak[:_TOLD])}{more}."] if weak else []
    parts += [f"Never in these data: {', '.join(never)}."] if never else []
    return " ".join(parts)
