"""The most discriminating next push, drawn on the table."""

from collections.abc import Sequence

from app.core.dialogue.words import duration
from app.core.types import Points
from app.discovery.dataset.names import effect_name, motion_name
from app.discovery.results.case import Case, NextPush
from app.report.drawing.chart import Plot, svg
from app.report.drawing.ground import bounds, cloud, ground, surface, table_bounds, way
from app.report.drawing.layout import columns, figure, legend, paragraph
from app.report.drawing.lens import close_up, enlarge, frame, lens
from app.report.drawing.markup import Markup, concat, tag
from app.report.drawing.side_view import ABOVE, projection, view_of
from app.report.drawing.words import best, decimal
from app.report.sections.verdict import unit_of
from app.sim.effects.base import LIQUIDS

_CLEAR = 2.0
"""Errors of the model by which two predictions differ clearly."""
_KINDS = ("end0", "end1", "end2", "end3")


def next_push(case: Case) -> Markup:
    """The sentence, the drawing, and its enlargement; or a note that no push is needed."""
    push = case.next_push
    if push is None:
        return paragraph(f"No {motion_name(case.kind)} is proposed: there is nothing left that one would tell apart.")
    side = tag("div", _detail(case, push), _numbers(case, push)) if _has_ends(case, push) else _numbers(case, push)
    return concat([paragraph(push.text, "lead"), columns(_drawing(case, push), side, kind="map")])


def _drawing(case: Case, push: NextPush) -> Markup:
    ends = push.ends if _has_ends(case, push) else ()
    key = [("before", "as it is"), *(_names(push) if ends else ()), ("tool", "way of the tool")]
    seen, view = projection(case.kind, push.track.positions), view_of(case.kind)
    before, track, drawn = seen(push.before), seen(push.track.positions), [seen(end) for end in ends]
    p = ground(table_bounds(case) if view is ABOVE else bounds([before, track, *drawn]), 540.0)
    drawing = svg(
        p.width,
        p.height,
        f"The next {motion_name(case.kind)}",
        f"The object as it is, the way of the tool{', and where each model sees it end' if ends else ''}.",
        surface(p, *view.axes),
        cloud(p, before, "before"),
        _ends(p, push, drawn),
        way(p, track),
        frame(p, lens(drawn[0], drawn[1])) if ends else "",
    )
    return figure(drawing, f"Seen {view.whence}. The tool starts at the dot.", legend=legend(key))


def _has_ends(case: Case, push: NextPush) -> bool:
    """True if predictions are drawn: of a liquid they are amounts, and where it is beside them means nothing."""
    return len(push.ends) > 1 and case.kind not in LIQUIDS


def _detail(case: Case, push: NextPush) -> Markup:
    drawn = [projection(case.kind, push.track.positions)(end) for end in push.ends]
    close = close_up(lens(drawn[0], drawn[1]))
    said = f"Where the models part most. {_worth(case, push.apart_mm)}"
    axes = view_of(case.kind).axes
    return figure(enlarge(close, "parting", "Where the models part most", said, _ends(close, push, drawn), axes), said)


def _worth(case: Case, apart_mm: float) -> str:
    """Value of one look at the object there, beside the error of the model itself."""
    error_mm, unit = case.gain.nominal_mm, unit_of(case)
    if not error_mm * _CLEAR > apart_mm:
        return "One look at the object there tells them apart."
    return (
        f"They differ there by {decimal(apart_mm, 1)} {unit}, and the model errs by {decimal(error_mm, 1)} {unit}: it "
        f"takes about {(_CLEAR * error_mm / apart_mm) ** 2:.0f} such {motion_name(case.kind, count=2)}."
    )


def _ends(p: Plot, push: NextPush, drawn: Sequence[Points]) -> Markup:
    return concat(cloud(p, end, kind) for end, kind in zip(drawn, _kinds(push), strict=False))


def _kinds(push: NextPush) -> list[str]:
    return [_KINDS[index % len(_KINDS)] for index in range(len(push.ends))]


def _names(push: NextPush) -> list[tuple[str, str]]:
    names = (f"end, with {effect_name(effect)}" for effect in push.between)
    return list(zip(_kinds(push), names, strict=False))


def _numbers(case: Case, push: NextPush) -> Markup:
    start, end = push.track.positions[0], push.track.positions[-1]
    if case.kind in LIQUIDS:
        apart = f"{decimal(push.apart_mm, 1)} {unit_of(case)}"
    else:
        apart = best(push.apart_mm * 1e-3, push.apart_mm * 1e-3, push.apart_mm * 1e-3, "m")
    rows = (
        ("Chosen to tell apart", " and ".join(effect_name(effect) for effect in push.between)),
        ("They differ by", apart),
        ("From", f"({start[0]:.2f}, {start[1]:.2f}) m"),
        ("To", f"({end[0]:.2f}, {end[1]:.2f}) m"),
        ("It takes", duration(float(push.track.times_s[-1] - push.track.times_s[0]))),
    )
    return tag("dl", *(concat([tag("dt", name), tag("dd", value)]) for name, value in rows), class_="facts")
