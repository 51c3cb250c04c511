"""The case file as one self-contained page: no network, no server, no other file."""

import base64
import hashlib
from collections.abc import Callable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Final

from app.core.errors import UsageError
from app.discovery.dataset.names import motion_name
from app.discovery.results.case import Case
from app.report.drawing.field import field
from app.report.drawing.layout import section
from app.report.drawing.markup import Markup, tag
from app.report.sections.advice import MODEL
from app.report.sections.causes import causes, confusions
from app.report.sections.checks import checks
from app.report.sections.examples import examples
from app.report.sections.frames import frames
from app.report.sections.gains import gains
from app.report.sections.masthead import masthead, scope
from app.report.sections.model import saved_model, stage_times
from app.report.sections.next_push import next_push
from app.report.sections.powers import powers
from app.report.sections.verdict import headline
from app.sim.effects.base import LIQUIDS, ObjectKind

SECTIONS: Final[tuple[tuple[str, str, str, Callable[[Case], Markup]], ...]] = (
    ("scope", "What was looked at", "How much there is, and what it cannot show.", scope),
    ("field", "Where the model is wrong", "Where the object is, against where the model puts it.", field),
    ("checks", "Direct checks", "What can be measured without simulating anything.", checks),
    ("frames", "Frame test", "In which frame is the error constant?", frames),
    ("causes", "Causes", "How probable each is, and how large it would be.", causes),
    ("confusions", "What could be confused", "Would these very {motions} tell the causes apart?", confusions),
    ("examples", "Before and after", "A {motion} that no model was fitted to.", examples),
    ("gains", "What is gained", "How much of the error goes away on such {motions}?", gains),
    ("powers", "What would be visible", "How large a cause has to be to show in these data.", powers),
    ("next", "The next {motion}", "Which {motion} would tell most?", next_push),
    ("model", "The saved model", "What a planner loads.", saved_model),
    ("spent", "Time spent", "Where the time of this analysis went.", stage_times),
)
"""Sections of the page in the order of reading: anchor, title, question, and its answer. `{motion}`, `{motions}`: see
`motion_name`."""


_OMITTED: Final[Mapping[ObjectKind, frozenset[str]]] = {
    **dict.fromkeys(LIQUIDS, frozenset({"field", "frames"})),
}
"""Sections that a kind of object has none of: displacements over the table of what is compared by amounts."""


def write_report(path: Path, case: Case) -> None:
    """Write the case file as HTML, beside the saved model. Raises UsageError where the file cannot be written."""
    try:
        path.write_text(page(case, path.with_name(MODEL.name)), encoding="utf-8")
    except OSError as error:
        raise UsageError(
            f"Cannot write the report to {path}: {error.strerror}; choose another place with -o."
        ) from None


def page(case: Case, model: Path = MODEL) -> str:
    """The case file as HTML. `model`: the saved model's file."""
    script = _asset("report.js")
    omitted = _OMITTED.get(case.kind, frozenset[str]())
    motion, motions = motion_name(case.kind), motion_name(case.kind, count=2)
    own = [
        (at, title.format(motion=motion), asks.format(motion=motion, motions=motions), part)
        for at, title, asks, part in SECTIONS
        if at not in omitted
    ]
    links = [(at, title) for at, title, _, _ in own]
    parts = [section(at, number, title, asks, part(case)) for number, (at, title, asks, part) in enumerate(own, 1)]
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=_policy(script)),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light dark"),
        tag("title", f"{headline(case)}: case file of {case.amount.task}"),
        tag("style", Markup(_asset("report.css"))),
        tag("noscript", tag("style", Markup(".off{display:revert}.chooser{display:none}"))),
    )
    body = tag(
        "body",
        masthead(case, model),
        _contents(links),
        tag("main", *parts),
        tag("script", Markup(script)),
    )
    return f"<!doctype html>\n{tag('html', head, body, lang='en').text}\n"


def _contents(sections: Sequence[tuple[str, str]]) -> Markup:
    return tag("nav", *(tag("a", title, href=f"#{at}") for at, title in sections), aria_label="Contents")


def _policy(script: str) -> str:
    """Content security policy: no loading, and no script but ours."""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'; img-src data:"


def _asset(name: str) -> str:
    return files("app.report").joinpath("assets", name).read_text(encoding="utf-8")
