"""Scores as SVG files: a confusion matrix, a reliability diagram, power curves."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np

from bench.hidden.curves import Bin, Confusion, Power

_CELL, _NAMES, _EDGE, _SIDE = 18, 190, 46, 300
_INK, _FAINT, _PAPER = "#1b2733", "#c8d0d8", "#ffffff"
_COLOURS = ("#2b6cb0", "#c05621", "#2f855a", "#97266d", "#6b46c1", "#b7791f")


def write_figures(folder: Path, confusion: Confusion, bins: Sequence[Bin], powers: Sequence[Power]) -> list[Path]:
    """All three, in a folder that is made where it is missing."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = {
        "confusion.svg": confusion_svg(confusion),
        "reliability.svg": reliability_svg(bins),
        "power.svg": power_svg(powers),
    }
    for name, text in drawn.items():
        (folder / name).write_text(text, encoding="utf-8")
    return [folder / name for name in drawn]


def confusion_svg(confusion: Confusion) -> str:
    """Draw a confusion matrix: rows are the hidden causes, columns the first answers, shades shares of the row."""
    size = _NAMES + _CELL * len(confusion.names)
    parts = list[str]()
    totals = np.maximum(confusion.counts.sum(1, keepdims=True), 1)
    for i, (name, counts) in enumerate(zip(confusion.names, confusion.counts.tolist(), strict=True)):
        middle = _NAMES + _CELL * (i + 0.5)
        parts.append(_text(_NAMES - 6, middle + 4, name, anchor="end"))
        parts.append(_text(middle + 4, _NAMES - 6, name, turned=True))
        for j, count in enumerate(counts):
            x, y, depth = _NAMES + _CELL * j, _NAMES + _CELL * i, count / float(totals[i, 0])
            parts.append(
                f'<rect x="{x}" y="{y}" width="{_CELL}" height="{_CELL}" fill="{_COLOURS[0]}" '
                f'fill-opacity="{depth:.2f}" stroke="{_FAINT}"/>'
            )
            if count:
                parts.append(
                    _text(
                        x + _CELL / 2,
                        y + _CELL / 2 + 4,
                        str(count),
                        anchor="middle",
                        colour=_PAPER if depth > 0.6 else _INK,
                    )
                )
    return _svg(size + 10, size + 10, parts)


def reliability_svg(bins: Sequence[Bin]) -> str:
    """The share that is right over the probability that was stated, with 95 % intervals; the diagonal is honest."""
    parts = [*_axes("stated probability", "share that is right", (0.0, 0.5, 1.0)), _line([(0, 0), (1, 1)], _FAINT)]
    for each in bins:
        if each.right.n:
            parts.append(_line([(each.stated, each.right.low), (each.stated, each.right.high)], _COLOURS[0]))
            x, y = _at(each.stated, each.right.value)
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{_COLOURS[0]}"/>')
            parts.append(_text(x + 6, y - 6, str(each.right.n)))
    return _svg(_SIDE + 2 * _EDGE, _SIDE + 2 * _EDGE, parts)


def power_svg(powers: Sequence[Power]) -> str:
    """The share that is named alone over the size in typical ones, a line for each class."""
    most = max((each.high for each in powers), default=1.0)
    parts = _axes("size / typical", "share named alone", (0.0, most / 2, most))
    for number, category in enumerate(dict.fromkeys(each.category for each in powers)):
        own = [each for each in powers if each.category == category]
        colour = _COLOURS[number % len(_COLOURS)]
        parts.append(_line([((each.low + each.high) / 2 / most, each.named.value) for each in own], colour))
        for each in own:
            x, y = _at((each.low + each.high) / 2 / most, each.named.value)
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>')
            parts.append(_text(x + 5, y - 5, str(each.named.n)))
        parts.append(_text(_EDGE + _SIDE + 8, _EDGE + 16 * (number + 1), category, colour=colour))
    return _svg(_SIDE + 2 * _EDGE + 150, _SIDE + 2 * _EDGE, parts)


def _axes(across: str, up: str, ticks: Sequence[float]) -> list[str]:
    """A square frame of 0 to 1 either way; `ticks` are what stands at the left end, the middle and the right end."""
    parts = [f'<rect x="{_EDGE}" y="{_EDGE}" width="{_SIDE}" height="{_SIDE}" fill="none" stroke="{_INK}"/>']
    for place, tick in zip((0.0, 0.5, 1.0), ticks, strict=True):
        x, y = _at(place, 0)
        parts.append(_text(x, y + 16, f"{tick:g}", anchor="middle"))
        x, y = _at(0, place)
        parts.append(_text(x - 6, y + 4, f"{place:g}", anchor="end"))
    parts.append(_text(_EDGE + _SIDE / 2, 2 * _EDGE + _SIDE - 10, across, anchor="middle"))
    return [*parts, _text(14, _EDGE + _SIDE / 2, up, turned=True, anchor="middle")]


def _at(x: float, y: float) -> tuple[float, float]:
    return _EDGE + _SIDE * x, _EDGE + _SIDE * (1 - y)


def _line(places: Sequence[tuple[float, float]], colour: str) -> str:
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in (_at(*place) for place in places))
    return f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>'


def _text(
    x: float,
    y: float,
    said: str,
    *,
    anchor: str = "start",
    turned: bool = False,
    light: bool = False,
    colour: str = _INK,
) -> str:
    turn = f' transform="rotate(-90 {x:.1f} {y:.1f})"' if turned else ""
    fill = "#ffffff" if light else colour
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{fill}"{turn}>{escape(said)}</text>'


def _svg(width: float, height: float, parts: Sequence[str]) -> str:
    size = f'width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.0f} {height:.0f}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="11">'
    return "\n".join([head, f'<rect width="100%" height="100%" fill="{_PAPER}"/>', *parts, "</svg>"]) + "\n"
