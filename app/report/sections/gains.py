"""Gain of the extended model on held-out episodes."""

import math

import numpy as np

from app.discovery.dataset.names import motion_name
from app.discovery.results.case import Case, Gain
from app.report.drawing.chart import axes, dots, label, line, nice_step, plot, polyline, svg
from app.report.drawing.layout import columns, figure, legend, paragraph
from app.report.drawing.markup import Markup, concat, tag
from app.report.drawing.words import decimal
from app.report.sections.verdict import gain_sentence, is_extended, unit_of

_WIDTH, _HEIGHT = 250.0, 250.0
_MARGINS = (14.0, 14.0, 46.0, 58.0)


def gains(case: Case) -> Markup:
    """The gain in words, and in up to three small figures."""
    drawn = [_bars(case.gain, unit_of(case))] if math.isfinite(case.gain.nominal_mm) else []
    drawn += [_pairs(case)] if np.isfinite(case.per_episode).any() and is_extended(case.gain) else []
    drawn += [_steps(case)] if len(case.steps) > 1 and np.isfinite(case.steps).any() else []
    kinds = [("still", "no motion: nothing moves"), ("nominal", "refitted nominal model")]
    key = legend([*kinds, ("extended", "extended model")] if is_extended(case.gain) else kinds)
    return concat([paragraph(gain_sentence(case.gain, unit_of(case)), "lead"), key, columns(*drawn, kind="three")])


def _bars(gain: Gain, unit: str) -> Markup:
    values = (
        ("no motion", gain.still_mm, "still"),
        ("nominal", gain.nominal_mm, "nominal"),
        ("extended", gain.extended_mm, "extended"),
    )
    known = [entry for entry in values if math.isfinite(entry[1]) and (entry[2] != "extended" or is_extended(gain))]
    p = plot(_WIDTH, _HEIGHT, (0.0, float(len(known))), (0.0, _above(max(value for _, value, _ in known))), _MARGINS)
    drawn = list[Markup]()
    for index, (name, value, kind) in enumerate(known):
        x, top = p.x(index + 0.5), p.y(value)
        drawn += [
            tag("rect", x=x - 21, y=top, width=42.0, height=p.y.start - top, rx=2.0, class_=f"fill {kind}"),
            label(x, top - 6, decimal(value, 1), "strong", anchor="middle"),
            label(x, p.y.start + 18, name, "tick", anchor="middle"),
        ]
    said = "; ".join(f"{name} {decimal(value, 1)} {unit}" for name, value, _ in known)
    drawing = svg(p.width, p.height, "One-step error", said, axes(p, "", f"one-step error [{unit}]", x_count=0), *drawn)
    return figure(drawing, "Held-out one-step errors. A model is of use where its bar is well below that of no motion.")


def _pairs(case: Case) -> Markup:
    values = case.per_episode[np.isfinite(case.per_episode).all(axis=1)]
    better = int((values[:, 1] < values[:, 0]).sum())
    p = plot(_WIDTH, _HEIGHT, (-0.35, 1.35), (0.0, _above(float(values.max(initial=0.0)))), _MARGINS)
    pairs = [(p.at((0.0, pair[0])), p.at((1.0, pair[1]))) for pair in values]
    drawing = svg(
        p.width,
        p.height,
        "Errors episode by episode",
        f"The extended model is better in {better} of {len(values)} episodes.",
        axes(p, "", f"one-step error [{unit_of(case)}]", x_count=0),
        *(line(*pair, "pair" if b < a else "pair worse") for pair, (a, b) in zip(pairs, values, strict=True)),
        dots([start for start, _ in pairs], "mid nominal"),
        dots([end for _, end in pairs], "mid extended"),
        label(p.x(0.0), p.y.start + 18, "nominal", "tick", anchor="middle"),
        label(p.x(1.0), p.y.start + 18, "extended", "tick", anchor="middle"),
    )
    return figure(drawing, f"A line an episode: better in {better} of {len(values)}. Broken lines rise.")


def _steps(case: Case) -> Markup:
    values, unit, motions = case.steps, unit_of(case), motion_name(case.kind, count=2)
    p = plot(_WIDTH, _HEIGHT, (0.6, len(values) + 0.4), (0.0, _above(float(np.nanmax(values)))), _MARGINS)
    curves = [
        [p.at((step + 1.0, value)) for step, value in enumerate(values[:, k]) if math.isfinite(value)] for k in range(2)
    ]
    drawing = svg(
        p.width,
        p.height,
        f"Errors over several {motions}",
        "; ".join(f"after {k + 1}: {decimal(a, 1)} and {decimal(b, 1)} {unit}" for k, (a, b) in enumerate(values)),
        axes(p, f"{motions} predicted in a row", f"error [{unit}]", x_count=max(len(values), 1)),
        *(
            concat([polyline(curve, f"curve {kind}"), dots(curve, f"mid {kind}")])
            for curve, kind in zip(curves, ("nominal", "extended"), strict=True)
            if kind == "nominal" or is_extended(case.gain)
        ),
    )
    return figure(drawing, f"How errors grow when {motions} are predicted one after another, as a planner does.")


def _above(largest: float) -> float:
    """A round number above the largest value."""
    step = nice_step(largest / 5) if largest > 0 else 1.0
    return step * math.ceil(1.12 * largest / step) if largest > 0 else 1.0
