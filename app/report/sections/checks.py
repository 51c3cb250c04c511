"""The direct measurements, without simulation: a row a check, its interval beside the expected value."""

import math

from app.core.dialogue.words import NOTHING, sentence
from app.discovery.results.case import Case, Estimate
from app.report.drawing.chart import Axis, line, svg
from app.report.drawing.layout import paragraph, table
from app.report.drawing.markup import Markup, concat, tag
from app.report.drawing.words import best, decimal, display, interval, with_symbol

_WIDTH, _HEIGHT = 150.0, 22.0


def checks(case: Case) -> Markup:
    """The table of checks, and the number of sound ones."""
    if not case.checks:
        return paragraph(
            "Nothing could be checked without simulating: finger, bare table and measured poses are missing."
        )
    unsound = [check for check in case.checks if not check.holds_null]
    said = (
        f"{len(unsound)} of {len(case.checks)} checks are off: what would be right lies outside of the interval."
        if unsound
        else f"All {len(case.checks)} checks are sound: what would be right lies in every interval."
    )
    heads = ("", "Check", "Measured", "90 % interval", "Right would be", "Bar: interval; tick: right value")
    rows = [_row(check) for check in case.checks]
    return concat([paragraph(said, "lead"), table(heads, rows, numbers=(2, 3, 4), kind="checks")])


def _row(check: Estimate) -> tuple[Markup, Markup, str, str, str, Markup]:
    mark = tag(
        "span", "sound" if check.holds_null else "off", class_=f"mark {'sound' if check.holds_null else 'unsound'}"
    )
    name = concat([tag("b", sentence(check.name)), tag("small", check.about)])
    numbers = (check.value, check.low, check.high, check.unit)
    return mark, name, best(*numbers), interval(*numbers), _expectation(check), _strip(check)


def _expectation(check: Estimate) -> str:
    shown = display(check.unit, check.value, check.low, check.high)
    return with_symbol(decimal(check.null * shown.factor, 0), shown) if math.isfinite(check.null) else NOTHING


def _strip(check: Estimate) -> Markup:
    """The interval as a bar, with a tick at the expected value."""
    values = [check.low, check.high, check.value, check.null]
    if not all(map(math.isfinite, values)):
        return tag("span", NOTHING)
    x = Axis(low=min(values), high=max(values), start=10.0, end=_WIDTH - 10)
    kind, middle = "sound" if check.holds_null else "unsound", _HEIGHT / 2
    return svg(
        _WIDTH,
        _HEIGHT,
        f"{check.name}: {'sound' if check.holds_null else 'off'}",
        "The interval as a bar, the value as a dot, and what would be right as a tick.",
        line((4.0, middle), (_WIDTH - 4, middle), "grid"),
        line((x(check.low), middle), (x(check.high), middle), f"bar {kind}"),
        tag("circle", cx=x(check.value), cy=middle, r=4.5, class_=f"value {kind}"),
        line((x(check.null), 2.0), (x(check.null), _HEIGHT - 2), "right"),
    )
