"""Residual field of the model: arrows on the table, along the object and push by push."""

import numpy as np
from jaxtyping import Float64

from app.core.dialogue.words import sentence
from app.discovery.dataset.names import motion_name
from app.discovery.results.case import Case, ResidualField
from app.report.drawing.chart import Plot, area, arrow_path, axes, dots, label, nice_step, plot, polyline, svg
from app.report.drawing.ground import ground, surface, table_bounds
from app.report.drawing.layout import chooser, columns, figure, legend, paragraph
from app.report.drawing.markup import Markup, concat, tag
from app.report.drawing.words import MINUS, decimal, percent

_CELL_M = 0.06
"""Size of the squares over which residuals are averaged where all pushes are shown."""
_LEAST_IN_CELL = 4
_DRAWN = 3000
"""Most arrows drawn."""
_LONGEST_M = 0.04
"""Approximate length of the larger arrows on the table."""
_SHADES = 5
_BINS = 12


def field(case: Case) -> Markup:
    """The map, and beside it the same residuals by push, and by place along an object that has a length."""
    arrows = case.arrows
    if not len(arrows.places):
        return paragraph("No residuals were measured: there are no motions that the model could be compared with.")
    by_place = [_along_figure(arrows)] if arrows.along.any() else []  # Loose pieces have no place along anything.
    return columns(_map_figure(case), tag("div", *by_place, _in_order(case, arrows)), kind="map")


def _map_figure(case: Case) -> Markup:
    arrows, p = case.arrows, ground(table_bounds(case), 540.0)
    sizes = lengths_mm(arrows)
    shade = nice_step(float(np.quantile(sizes, 0.95)) / _SHADES)
    times = _magnification(sizes)
    pushes = np.unique(arrows.push)
    step = max(1, -(-len(sizes) // _DRAWN))
    layers = [_layer(p, arrows, arrows.push == push, shade, times, f"{push:g}", step) for push in pushes]
    drawing = svg(
        p.width,
        p.height,
        "Residuals on the table",
        f"Arrows from where the model puts the object to where it is, drawn {times:g} times as long. "
        f"{_agreement(arrows)}",
        surface(p),
        tag("g", *layers, class_="single-arrows"),
        _means(p, arrows, shade, times),
        _key(p, times),
    )
    motion = motion_name(case.kind)
    options = [
        ("all", "all, and their mean in squares of 6 cm"),
        *((f"{push:g}", f"{motion} {push:g}") for push in pushes),
    ]
    return figure(
        drawing,
        f"Each arrow leads from where the refitted nominal model puts a bit of the object to where it was, {times:g} "
        f"times as long as it is. {_agreement(arrows)}",
        controls=chooser("field", f"{sentence(motion_name(case.kind, count=2))} shown", options),
        legend=legend([(f"shade{k}", _range(k, shade)) for k in range(_SHADES)]),
    )


def lengths_mm(arrows: ResidualField) -> Float64[np.ndarray, " M"]:
    """Lengths of the residuals [mm]."""
    return 1e3 * np.linalg.norm(arrows.displacements.astype(np.float64), axis=1)


def _agreement(arrows: ResidualField) -> str:
    """Sentence on the agreement of the arrows."""
    mean, size = 1e3 * arrows.displacements.mean(0), float(lengths_mm(arrows).mean())
    common = float(np.linalg.norm(mean))
    agreement = common / size if size > 0 else 0.0
    means = f"Their mean length is {decimal(size, 1)} mm"
    if agreement > 0.5:
        along = f"({decimal(float(mean[0]), 1)}, {decimal(float(mean[1]), 1)}) mm in x and y"
        return f"{means}, and most of it is common to all: {along}, {percent(agreement)} of the length."
    return f"{means}; their directions differ, so no constant offset explains them."


def _layer(
    p: Plot, arrows: ResidualField, chosen: np.ndarray, shade: float, times: float, key: str, step: int
) -> Markup:
    paths = _paths(p, arrows.places[chosen][::step], arrows.displacements[chosen][::step], shade, times, 5.0)
    return tag("g", paths, data_of="field", data_key=key)


def _means(p: Plot, arrows: ResidualField, shade: float, times: float) -> Markup:
    """The mean residual of each square of the table with enough of them."""
    cells, index = np.unique(np.floor(arrows.places / _CELL_M), axis=0, return_inverse=True)
    counts = np.bincount(index.ravel(), minlength=len(cells))
    mean = [
        np.stack([np.bincount(index.ravel(), v[:, k]) for k in range(2)], 1) / counts[:, None]
        for v in (arrows.places, arrows.displacements)
    ]
    enough = counts >= _LEAST_IN_CELL
    paths = _paths(p, mean[0][enough], mean[1][enough], shade, times, 9.0)
    return tag("g", paths, class_="mean-arrows", data_of="field", data_key="all")


def _paths(p: Plot, places: np.ndarray, displacements: np.ndarray, shade: float, times: float, head: float) -> Markup:
    """Arrows in one path a shade."""
    shades = np.minimum(1e3 * np.linalg.norm(displacements, axis=1) / shade, _SHADES - 1).astype(int)
    ends = places + times * displacements
    drawn = [
        "".join(arrow_path(p.at(places[i]), p.at(ends[i]), head) for i in np.flatnonzero(shades == k))
        for k in range(_SHADES)
    ]
    return concat(tag("path", d=path, class_=f"arrow shade{k}") for k, path in enumerate(drawn) if path)


def _key(p: Plot, times: float) -> Markup:
    """An arrow of a known length, in the corner."""
    size = nice_step(0.6 * _LONGEST_M * 1e3 / times)
    end = (p.x.end - 14, p.y.start - 14)
    start = (end[0] - (p.x(size * 1e-3 * times) - p.x(0.0)), end[1])
    text = label(end[0], end[1] - 9, f"{size:g} mm", "key", anchor="end")
    return concat([tag("path", d=arrow_path(start, end, 8.0), class_="key-arrow"), text])


def _magnification(sizes: np.ndarray) -> float:
    """Magnification of the arrows: 1, 2, 5, 10, ... times."""
    large = float(np.quantile(sizes, 0.9)) * 1e-3
    return max(1.0, nice_step(_LONGEST_M / large / 2)) if large > 0 else 1.0


def _range(k: int, shade: float) -> str:
    low, high = (f"{shade * number:g}" for number in (k, k + 1))
    return f"over {low} mm" if k == _SHADES - 1 else f"{low} to {high} mm"


def _along_figure(arrows: ResidualField) -> Markup:
    """The size of residuals along the object: median, and the range of 80 % of them."""
    sizes, edges = lengths_mm(arrows), np.linspace(-1, 1, _BINS + 1)
    bins = np.clip(np.digitize(arrows.along, edges) - 1, 0, _BINS - 1)
    middles = [float(edges[k] + edges[k + 1]) / 2 for k in range(_BINS) if (bins == k).any()]
    low, median, high = (
        [float(np.quantile(sizes[bins == k], share)) for k in range(_BINS) if (bins == k).any()]
        for share in (0.1, 0.5, 0.9)
    )
    p = plot(300.0, 210.0, (-1.0, 1.0), (0.0, max(high) * 1.1 or 1.0))
    drawing = svg(
        p.width,
        p.height,
        "Residuals along the object",
        f"Median from {min(median):.1f} to {max(median):.1f} mm between its ends.",
        axes(p, f"place along the object (ends at {MINUS}1 and 1)", "residual [mm]", x_count=4, y_count=4),
        area(
            [p.at(at) for at in (*zip(middles, low, strict=True), *list(zip(middles, high, strict=True))[::-1])], "band"
        ),
        polyline([p.at(at) for at in zip(middles, median, strict=True)], "curve nominal"),
    )
    return figure(drawing, f"Along the object: {_where(middles, median)} Line: median; band: 80 % of the residuals.")


def _where(middles: list[float], median: list[float]) -> str:
    """Phrase on the part of the object with the largest residuals, if one stands out."""
    worst = int(np.argmax(median))
    if median[worst] < 1.5 * float(np.median(median)):
        return "no part of it is much worse than the others."
    place = "near its middle" if abs(middles[worst]) < 0.4 else "towards one of its ends"
    return f"worst {place}, at {decimal(middles[worst], 1)}."


def _in_order(case: Case, arrows: ResidualField) -> Markup:
    """The mean size of residuals, one motion after another."""
    motion, motions = motion_name(case.kind), motion_name(case.kind, count=2)
    sizes, pushes = lengths_mm(arrows), np.unique(arrows.push)
    means = [float(sizes[arrows.push == push].mean()) for push in pushes]
    x_range = (float(pushes[0]) - 0.5, float(pushes[-1]) + 0.5)
    p = plot(300.0, 190.0, x_range, (0.0, max(means) * 1.15 or 1.0))
    drawing = svg(
        p.width,
        p.height,
        f"Residuals, {motion} by {motion}",
        f"Mean residual from {min(means):.1f} to {max(means):.1f} mm over {len(means)} {motions}.",
        axes(p, f"{motion}, in the order made", "residual [mm]", y_count=4),
        dots([p.at((float(push), mean)) for push, mean in zip(pushes, means, strict=True)], "mid nominal"),
    )
    return figure(
        drawing,
        f"{sentence(motion)} by {motion}: a slope would mean a change in time, a step would say when it came.",
    )
