"""Held-out pushes as observed and as both models predict them, with the largest difference enlarged."""

from dataclasses import replace

from app.discovery.dataset.names import motion_name
from app.discovery.results.case import Case, Example
from app.report.drawing.chart import Plot, svg
from app.report.drawing.ground import bounds, cloud, ground, surface, way
from app.report.drawing.layout import chooser, columns, figure, legend, paragraph
from app.report.drawing.lens import LENS_M, apart_mm, close_up, enlarge, frame, lens
from app.report.drawing.markup import Markup, concat, tag
from app.report.drawing.side_view import View, projection, view_of
from app.report.drawing.words import decimal
from app.report.sections.verdict import is_extended

_KEY = (
    ("before", "before the motion"),
    ("nominal", "nominal model"),
    ("extended", "extended model"),
    ("observed", "observed after it"),
    ("tool", "way of the tool"),
)

_KEY_OF_ONE = tuple(entry for entry in _KEY if entry[0] != "extended")


def examples(case: Case) -> Markup:
    """The held-out motions, shown one at a time."""
    motion = motion_name(case.kind)
    if not case.examples:
        return paragraph(f"No episode was held out, so there is no {motion} that the models had not seen.")
    options = [(str(index), f"{motion} {it.number}") for index, it in enumerate(case.examples)]
    view = view_of(case.kind)
    shown = [
        tag(
            "div",
            _example(_seen(case, it), index, motion, view, extended=is_extended(case.gain)),
            data_of="example",
            data_key=str(index),
            class_="off" if index else None,
        )
        for index, it in enumerate(case.examples)
    ]
    return concat([chooser("example", f"Held-out {motion}", options), *shown])


def _seen(case: Case, it: Example) -> Example:
    """The same as it is drawn."""
    seen = projection(case.kind, it.tool)
    return replace(
        it,
        before=seen(it.before),
        observed=seen(it.observed),
        nominal=seen(it.nominal),
        extended=seen(it.extended),
        tool=seen(it.tool),
    )


def _example(it: Example, index: int, motion: str, view: View, *, extended: bool) -> Markup:
    whole = ground(bounds((it.before, it.observed, it.nominal, it.extended, it.tool)), 440.0, 480.0)
    near = lens(it.observed, it.nominal)
    drawing = svg(
        whole.width,
        whole.height,
        f"Held-out {motion} {it.number}",
        f"The object before and after the {motion} and as both models predict it, {view.whence}, with the tool's way.",
        surface(whole, *view.axes),
        cloud(whole, it.before, "before"),
        _ends(whole, it, extended=extended),
        way(whole, it.tool),
        frame(whole, near),
    )
    close = close_up(near)
    detail = enlarge(
        close,
        f"example{index}",
        f"Held-out {motion} {it.number}, where the nominal model is worst",
        f"Where the nominal model is farthest from what was seen, in a square of {200 * LENS_M:g} cm.",
        _ends(close, it, extended=extended),
        view.axes,
    )
    return columns(
        figure(drawing, _caption(it, extended=extended), legend=legend(_KEY if extended else _KEY_OF_ONE)),
        figure(detail, "What the frame holds: where the nominal model is farthest from what was seen."),
        kind="lensed",
    )


def _ends(p: Plot, it: Example, *, extended: bool) -> Markup:
    """The observed object over the predictions of both models, or of the only one."""
    predicted = [cloud(p, it.nominal, "nominal"), *([cloud(p, it.extended, "extended")] if extended else [])]
    return concat([*predicted, cloud(p, it.observed, "observed")])


def _caption(it: Example, *, extended: bool) -> str:
    nominal, better = (decimal(apart_mm(it.observed, cloud), 1) for cloud in (it.nominal, it.extended))
    with_extended = f", {better} mm with the extended one" if extended else ""
    return (
        "The better a model, the more its dots lie on those observed. From an observed point to the nearest predicted "
        f"one it is {nominal} mm in the mean with the nominal model{with_extended}."
    )
