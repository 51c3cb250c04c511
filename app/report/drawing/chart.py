"""Figures as inline SVG: axes with units and even ticks, lines, dots and their text alternatives.

Colours are classes, so that the page's light, dark and printed looks apply (report.css).
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from app.report.drawing.markup import Child, Markup, concat, short, tag
from app.report.drawing.words import decimal


@final
@dataclass(frozen=True, kw_only=True)
class Axis:
    """Maps values from `low` to `high` to pixels from `start` to `end`."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: float) -> float:
        """The pixel of a value."""
        return self.start + (value - self.low) / ((self.high - self.low) or 1.0) * (self.end - self.start)

    def ticks(self, count: int = 5) -> list[float]:
        """About so many even numbers within the axis."""
        if count == 0:
            return []
        step = nice_step((self.high - self.low) / count)
        first, last = math.ceil(self.low / step - 1e-6), math.floor(self.high / step + 1e-6)
        return [step * number for number in range(first, last + 1)]


@final
@dataclass(frozen=True, kw_only=True)
class Plot:
    """Two axes in a drawing of a width and a height."""

    width: float
    height: float
    x: Axis
    y: Axis

    def at(self, point: Sequence[float] | np.ndarray) -> tuple[float, float]:
        """The pixels of a point."""
        return self.x(float(point[0])), self.y(float(point[1]))


def plot(
    width: float,
    height: float,
    x: tuple[float, float],
    y: tuple[float, float],
    margins: tuple[float, float, float, float] = (12.0, 12.0, 44.0, 58.0),
) -> Plot:
    """A plot of these ranges, with margins at the top, right, bottom and left."""
    top, right, bottom, left = margins
    return Plot(
        width=width,
        height=height,
        x=Axis(low=x[0], high=x[1], start=left, end=width - right),
        y=Axis(low=y[0], high=y[1], start=height - bottom, end=top),
    )


def nice_step(least: float) -> float:
    """The smallest of 1, 2, 5, 10, ... times a power of ten that is at least this."""
    if not math.isfinite(least) or least <= 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(least))
    return next(power * factor for factor in (1.0, 2.0, 5.0, 10.0) if power * factor >= least * (1 - 1e-9))


def svg(width: float, height: float, title: str, description: str, *children: Child) -> Markup:
    """A drawing with a text alternative for screen readers."""
    return tag(
        "svg",
        tag("title", title),
        tag("desc", description),
        *children,
        viewBox=f"0 0 {short(width)} {short(height)}",
        width=width,
        height=height,
        role="img",
        aria_label=f"{title}. {description}",
    )


def axes(p: Plot, x_label: str, y_label: str, *, x_count: int = 5, y_count: int = 5, grid: str = "y") -> Markup:
    """Ticks with numbers and labels; faint lines across along the axes named in `grid`."""
    return concat([*_x_axis(p, x_label, x_count, "x" in grid), *_y_axis(p, y_label, y_count, "y" in grid)])


def _x_axis(p: Plot, title: str, count: int, grid: bool) -> Iterable[Markup]:
    values = p.x.ticks(count)
    for value, written in zip(values, tick_labels(values), strict=True):
        yield line((p.x(value), p.y.start), (p.x(value), p.y.end if grid else p.y.start + 4), "grid")
        yield label(p.x(value), p.y.start + 17, written, "tick", anchor="middle")
    yield line((p.x.start, p.y.start), (p.x.end, p.y.start), "axis")
    yield label((p.x.start + p.x.end) / 2, p.y.start + 36, title, "name", anchor="middle")


def _y_axis(p: Plot, title: str, count: int, grid: bool) -> Iterable[Markup]:
    values = p.y.ticks(count)
    for value, written in zip(values, tick_labels(values), strict=True):
        yield line((p.x.start, p.y(value)), (p.x.end if grid else p.x.start - 4, p.y(value)), "grid")
        yield label(p.x.start - 8, p.y(value) + 4, written, "tick", anchor="end")
    if title:
        x, y = p.x.start - 46, (p.y.start + p.y.end) / 2
        turn = f"rotate(-90 {short(x)} {short(y)})"
        yield tag("text", title, x=x, y=y, class_="name", text_anchor="middle", transform=turn)


def tick_labels(values: Sequence[float]) -> list[str]:
    """Numbers of ticks, with as many places as their distance needs."""
    step = abs(values[1] - values[0]) if len(values) > 1 else 1.0
    places = max(0, -math.floor(math.log10(step) + 1e-9)) if step > 0 else 0
    return [decimal(value, places) for value in values]


def label(x: float, y: float, text: str, kind: str = "", *, anchor: str = "start") -> Markup:
    """Text at a pixel, on its base line."""
    return tag("text", text, x=x, y=y, class_=kind or None, text_anchor=anchor)


def line(start: tuple[float, float], end: tuple[float, float], kind: str) -> Markup:
    """A straight line between pixels."""
    return tag("path", d=f"M{_pair(start)}L{_pair(end)}", class_=kind)


def polyline(points: Iterable[tuple[float, float]], kind: str) -> Markup:
    """A line through pixels."""
    return tag("path", d="M" + "L".join(_pair(point) for point in points), class_=kind)


def area(points: Iterable[tuple[float, float]], kind: str) -> Markup:
    """A closed shape between pixels."""
    return tag("path", d="M" + "L".join(_pair(point) for point in points) + "Z", class_=kind)


def dots(points: Iterable[tuple[float, float]], kind: str) -> Markup:
    """Round dots at pixels, in one path: a line of no length with round ends, as wide as the class's stroke."""
    return tag("path", d="".join(f"M{_pair(point)}h0" for point in points), class_=f"dots {kind}")


def arrow_path(start: tuple[float, float], end: tuple[float, float], head: float) -> str:
    """An arrow between pixels as the data of a path; its head is at most half of it."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    length = math.hypot(dx, dy)
    if length < 1e-6:
        return ""
    ux, uy, size = dx / length, dy / length, min(head, length / 2)
    left = (end[0] - size * (ux + 0.55 * uy), end[1] - size * (uy - 0.55 * ux))
    right = (end[0] - size * (ux - 0.55 * uy), end[1] - size * (uy + 0.55 * ux))
    return f"M{_pair(start)}L{_pair(end)}M{_pair(left)}L{_pair(end)}L{_pair(right)}"


def _pair(point: tuple[float, float]) -> str:
    return f"{short(point[0])} {short(point[1])}"
