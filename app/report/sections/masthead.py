"""The top of the page: the verdict in large type, its sentences and key numbers; then the amount of data."""

import math
from pathlib import Path
from typing import Final

from app.discovery.dataset.names import motion_name
from app.discovery.results.case import Case
from app.report.drawing.layout import paragraph
from app.report.drawing.markup import Markup, concat, tag
from app.report.drawing.size import size
from app.report.drawing.words import best, decimal, interval, title
from app.report.sections.advice import advice
from app.report.sections.verdict import chance, headline, is_extended, is_missing_something, kind, unit_of

_PROGRAM: Final = "dipac "


def masthead(case: Case, model: Path) -> Markup:
    """Summary of the case for a reader of nothing else. `model`: the saved model's file."""
    return tag(
        "header",
        tag("p", tag("b", "dipac discover"), f"case file of {case.amount.task}", class_="brand"),
        tag("p", kind(case), class_="kicker"),
        tag("h1", headline(case)),
        tag("div", *(paragraph(text) for text in case.sentences), class_="sentences"),
        *_setup_list(case),
        *(tag("p", tag("b", it.text), " ", it.consequence, class_="forbids") for it in case.limits if it.fatal),
        tag("dl", *(_figure(*entry) for entry in _key_numbers(case)), class_="key"),
        tag("div", tag("h2", "What to do next"), *(_next(text) for text in advice(case, model)), class_="advice"),
        class_=f"masthead {case.verdict}",
    )


def _setup_list(case: Case) -> list[Markup]:
    """Object, tool and table as they were simulated, with the source of their numbers."""
    if case.setup is None:
        return []
    return [tag("ul", *(tag("li", text) for text in case.setup.words), class_="simulated")]


def _next(text: str) -> Markup:
    """A sentence of advice; a command at its end on a line of its own, to be copied."""
    said, program, command = text.partition(_PROGRAM)
    return tag("p", said.rstrip(), *((" ", tag("code", program, command)) if program else ()))


def _key_numbers(case: Case) -> list[tuple[str, str, str]]:
    """Name, number and explanation of each key figure."""
    known = chance(case)
    entries = [("Probability", *known)] if known is not None else []
    for blame in case.causes:
        it = size(blame)
        numbers = (it.value, it.low, it.high, it.unit)
        entries.append((title(it.name), best(*numbers), f"90 % interval {interval(*numbers)}"))
    gain, unit = case.gain, unit_of(case)
    still = f"{decimal(gain.still_mm, 1)} {unit} if nothing moved"
    if math.isfinite(gain.nominal_mm) and not is_extended(gain):
        errors = f"{decimal(gain.nominal_mm, 1)} {unit}"
        entries.append(
            ("Error of the refitted model", errors, f"over {gain.episodes} episodes, each left out in turn; {still}")
        )
    elif math.isfinite(gain.gain):
        low, high = decimal(100 * gain.low, 0), decimal(100 * gain.high, 0)
        entries.append(("Held-out error gone", f"{decimal(100 * gain.gain, 0)} %", f"90 % interval {low} to {high} %"))
        errors = f"{decimal(gain.nominal_mm, 1)} → {decimal(gain.extended_mm, 1)} {unit}"
        entries.append(("One-step error", errors, f"over {gain.episodes} episodes, each left out in turn; {still}"))
    return entries


def _figure(name: str, number: str, more: str) -> Markup:
    return tag("div", tag("dt", name), tag("dd", number), tag("dd", more, class_="more"))


def scope(case: Case) -> Markup:
    """Amount of data, and the conclusions that it cannot support."""
    it = case.amount
    counts = (
        (it.episodes, "episodes"),
        (it.pushes, motion_name(case.kind, count=2)),
        (it.during, f"seen during the {motion_name(case.kind)}"),
        (it.measured, "measured tracks"),
        (it.particles, "particles"),
    )
    listed = tag("dl", *(_count(number, name) for number, name in counts), class_="counts")
    if not case.limits:
        lacks = "Amount and variety of these data do not forbid a verdict."
        if case.verdict == "none" and is_missing_something(case):
            lacks += " They are too few for a sure one: “What would be visible” says how large one has to be to show."
        return concat([listed, paragraph(lacks)])
    limits = (
        tag("li", tag("b", limit.text), " ", limit.consequence, class_="fatal" if limit.fatal else None)
        for limit in case.limits
    )
    return concat([listed, tag("h3", "What these data cannot show"), tag("ul", *limits, class_="limits")])


def _count(number: int, name: str) -> Markup:
    return tag("div", tag("dd", str(number)), tag("dt", name))
