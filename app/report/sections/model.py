"""The saved extended model, and the time spent."""

import math

from app.core.dialogue.words import duration, sentence
from app.discovery.dataset.names import effect_name
from app.discovery.results.case import Case, Estimate
from app.report.drawing.chart import label, svg
from app.report.drawing.layout import figure, paragraph, table
from app.report.drawing.markup import Markup, concat, tag
from app.report.drawing.words import best, decimal, display, interval, title, with_symbol

_WIDTH, _ROW, _LABELS = 780.0, 24.0, 190.0


def saved_model(case: Case) -> Markup:
    """Every parameter of the saved model with its interval; the formula where there is one."""
    rows = [_row("Nominal, refitted", it) for it in case.nominal]
    rows += [_row(title(blame.effect), it) for blame in case.causes for it in blame.estimates]
    formula = Markup("")
    if case.formula is not None:
        rows += [_row(sentence(term.words), it) for term in case.formula.terms for it in term.estimates]
        terms = (tag("li", tag("code", term.formula), f": {term.words}") for term in case.formula.terms)
        formula = tag(
            "div", tag("code", case.formula.text), paragraph(case.formula.words), tag("ul", *terms), class_="formula"
        )
    if not rows:
        return paragraph("Nothing was fitted, so no model is saved.")
    heads = ("Part", "Parameter", "Value", "90 % interval", "Nominal model")
    return concat([formula, table(heads, rows, numbers=(2, 3, 4), kind="model")])


def _row(part: str, it: Estimate) -> tuple[str, Markup, str, str, str]:
    numbers = (it.value, it.low, it.high, it.unit)
    shown = display(it.unit, it.value, it.low, it.high)
    null = with_symbol(decimal(it.null * shown.factor, _places(it.null * shown.factor)), shown)
    name = concat([tag("b", sentence(effect_name(it.name))), tag("small", it.about)])
    return part, name, best(*numbers), interval(*numbers), null


def _places(value: float) -> int:
    """Decimal places that a round number needs."""
    return next((places for places in range(4) if math.isclose(value, round(value, places), abs_tol=1e-9)), 4)


def stage_times(case: Case) -> Markup:
    """A bar for each stage."""
    known = [(stage, seconds) for stage, seconds in case.spent_s if math.isfinite(seconds) and seconds >= 0]
    total = sum(seconds for _, seconds in known)
    if total <= 0:
        return paragraph("Nobody took the time.")
    longest = max(seconds for _, seconds in known)
    scale = (_WIDTH - _LABELS - 110) / longest
    drawn = list[Markup]()
    for index, (stage, seconds) in enumerate(known):
        y, long = _ROW * index + 12, max(seconds * scale, 1.5)
        drawn += [
            label(_LABELS - 12, y + 4, stage, "tick", anchor="end"),
            tag("rect", x=_LABELS, y=y - 7, width=long, height=14.0, rx=2.0, class_="fill still"),
            label(_LABELS + long + 8, y + 4, duration(seconds), "tick"),
        ]
    said = "; ".join(f"{stage} {duration(seconds)}" for stage, seconds in known)
    drawing = svg(_WIDTH, _ROW * len(known) + 4, "Time by stage", said, *drawn)
    return figure(drawing, f"{duration(total)} in all, bars in proportion.")
