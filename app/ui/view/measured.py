"""Card of what was measured of the object. Pure."""

from collections.abc import Callable, Mapping
from html import escape
from typing import Final

from app.core.dialogue import words
from app.core.dialogue.object_messages import MeasuredObject, MeasuredSize
from app.ui.parts.cards import table

_MM: Final = 1e3
_TEXTS: Final[Mapping[str, tuple[str, Callable[[float], str]]]] = {
    "length_m": ("Length", lambda value: f"{_MM * value:.0f} mm"),
    "radius_m": ("Radius", lambda value: f"{_MM * value:.1f} mm"),
    "size_m": ("Side", lambda value: f"{_MM * value:.0f} mm"),
    "mass_kg": ("Mass", lambda value: f"{_MM * value:.1f} g"),
    "volume_m3": ("Volume", lambda value: f"{1e6 * value:.0f} ml"),
    "density_kg_m3": ("Density", lambda value: f"{value:.0f} kg/m\N{SUPERSCRIPT THREE}"),
    "count": ("Pieces", lambda value: f"{value:.0f}"),
    "piece_length_m": ("Length of one", lambda value: f"{_MM * value:.1f} mm"),
    "piece_width_m": ("Width of one", lambda value: f"{_MM * value:.1f} mm"),
}


def card(found: MeasuredObject | None) -> str:
    """Table of what was measured, with its errors, and what was not."""
    if found is None:
        said = "Lay the object down whole and in view, and measure it. Whatever is measured can be corrected."
        return f"<div class='dp'><small>{said}</small></div>"
    rows = [_row(size) for size in found.sizes]
    if found.colours is not None:
        low, high = found.colours.hue_deg
        rows.append(("Hue", f"{low:.0f} to {high:.0f} degrees"))
    notes = "".join(f"<small>{escape(note)}</small><br>" for note in found.notes)
    return (
        f"<div class='dp'><b>{escape(found.kind).capitalize()}</b>, from {found.views} views{table(rows)}{notes}</div>"
    )


def _row(size: MeasuredSize) -> tuple[str, str]:
    label, text = _TEXTS.get(size.name, (size.name, words.number))
    error = f" \N{PLUS-MINUS SIGN} {text(size.sd)}" if size.seen else ", assumed"
    return label, text(size.value) + error
