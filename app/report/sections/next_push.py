"""The most discriminating next push, drawn on the table."""

from app.core.dialogue.words import duration
from app.discovery.dataset.names import effect_name
from app.discovery.results.case import Case, NextPush
from app.report.drawing.chart import Plot, svg
from app.report.drawing.ground import cloud, ground, surface, table_bounds, way
from app.report.drawing.layout import columns, figure, legend, paragraph
from app.report.drawing.lens import close_up, enlarge, frame, lens
from app.report.drawing.markup import Markup, concat, tag
from app.report.drawing.words import best, decimal

_CLEAR = 2.0
"""Errors of the model by which two predictions differ clearly."""
_KINDS = ("end0", "end1", "end2", "end3")


def next_push(case: Case) -> Markup:
    """The sentence, the drawing, and its enlargement; or a note that no push is needed."""
    push = case.next_push
    if push is None:
        return paragraph("No push is proposed: there is nothing left that one would tell apart.")
    side = tag("div", _detail(case, push), _numbers(push)) if len(push.ends) > 1 else _numbers(push)
    return concat([paragraph(push.text, "lead"), columns(_drawing(case, push), side, kind="map")])


def _drawing(case: Case, push: NextPush) -> Markup:
    p = ground(table_bounds(case), 540.0)
    key = [("before", "as it lies"), *_names(push), ("tool", "way of the tool")]
    drawing = svg(
        p.width,
        p.height,
        "The next push",
        "The object as it lies, the way of the tool, and where each model sees it end.",
        surface(p),
        cloud(p, push.before, "before"),
        _ends(p, push),
        way(p, push.track.positions),
        frame(p, lens(push.ends[0], push.ends[1])) if len(push.ends) > 1 else "",
    )
    return figure(drawing, "The push on the table. The tool starts at the dot.", legend=legend(key))


def _detail(case: Case, push: NextPush) -> Markup:
    close = close_up(lens(push.ends[0], push.ends[1]))
    said = f"Where the models part most. {_worth(push.apart_mm, case.gain.nominal_mm)}"
    return figure(enlarge(close, "parting", "Where the models part most", said, _ends(close, push)), said)


def _worth(apart_mm: float, error_mm: float) -> str:
    """Value of one look at the object there, beside the error of the model itself."""
    if not error_mm * _CLEAR > apart_mm:
        return "One look at the object there tells them apart."
    return (
        f"They differ there by {decimal(apart_mm, 1)} mm, and the model errs by {decimal(error_mm, 1)} mm: it takes "
        f"about {(_CLEAR * error_mm / apart_mm) ** 2:.0f} such pushes."
    )


def _ends(p: Plot, push: NextPush) -> Markup:
    return concat(cloud(p, end, kind) for end, kind in zip(push.ends, _kinds(push), strict=True))


def _kinds(push: NextPush) -> list[str]:
    return [_KINDS[index % len(_KINDS)] for index in range(len(push.ends))]


def _names(push: NextPush) -> list[tuple[str, str]]:
    names = (f"end, with {effect_name(effect)}" for effect in push.between)
    return list(zip(_kinds(push), names, strict=False))


def _numbers(push: NextPush) -> Markup:
    start, end = push.track.positions[0], push.track.positions[-1]
    rows = (
        ("Chosen to tell apart", " and ".join(effect_name(effect) for effect in push.between)),
        ("They differ by", best(push.apart_mm * 1e-3, push.apart_mm * 1e-3, push.apart_mm * 1e-3, "m")),
        ("From", f"({start[0]:.2f}, {start[1]:.2f}) m"),
        ("To", f"({end[0]:.2f}, {end[1]:.2f}) m"),
        ("It takes", duration(float(push.track.times_s[-1] - push.track.times_s[0]))),
    )
    return tag("dl", *(concat([tag("dt", name), tag("dd", value)]) for name, value in rows), class_="facts")
