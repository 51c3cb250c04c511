"""The texts about the cameras and their views of the object, as HTML. Pure, as `cards`."""

import math
from collections.abc import Iterable, Mapping
from datetime import date, datetime
from html import escape
from typing import Final, Literal, TypeAlias

from app.core.dialogue import words
from app.core.dialogue.segmentation_message import Seen
from app.core.geometry.camera import CameraModel
from app.core.messages import Episode, Frame
from app.ui.parts.cards import in_colour, table
from app.ui.parts.console_state import ConsoleState

Origin: TypeAlias = Literal["simulated", "recorded", "real"]
"""Source of the cameras' images."""
_MM: Final = 1e3
APART_M: Final = 4e-3
"""Distance between two cameras' points of the object beyond which their poses contradict the calibration."""
_LATE_S: Final = 2.0
"""Age from which a picture is marked as old: younger ones are live for cameras of two frames a second."""


def summary(state: ConsoleState) -> str:
    """Card of the number of particles, and of the agreement of the cameras."""
    count = str(len(state.particles.positions)) if state.particles else words.NOTHING
    apart = max(state.seen.apart_m.values(), default=math.nan) if state.seen else math.nan
    rows = [("Particles", count), ("Cameras apart", _apart(apart))]
    warning = ""
    if apart > APART_M:
        warning = (
            "<p class='dp-warn'>The cameras see the object in different places: switch the clouds on, look for double "
            "edges, and calibrate the camera that is off.</p>"
        )
    return f'<div class="dp">{table(rows)}{warning}</div>'


def camera(state: ConsoleState, frame: Frame, now_s: float, *, today: date, previewed: int | None = None) -> str:
    """Card of one camera: its view of the object, its calibration, and the age of its picture.

    `previewed`: number of pixels of colours that are not in use yet.
    """
    rows = _camera_rows(state.seen, frame, now_s, origin=_origin(state.episode), today=today, previewed=previewed)
    return f'<div class="dp">{table(rows)}</div>'


def _camera_rows(
    seen: Seen | None, frame: Frame, now_s: float, *, origin: Origin, today: date, previewed: int | None
) -> Iterable[tuple[str, str]]:
    name = frame.camera.name
    if seen is not None and name in seen.pixels:
        yield "Pixels of the object", _count(seen.pixels[name], warn=seen.pixels[name] == 0)
        yield "Points with depth", _count(seen.points.get(name, 0), warn=seen.points.get(name, 0) == 0)
        if name in seen.apart_m:
            yield "From the others", _apart(seen.apart_m[name])
    if previewed is not None:
        yield "Pixels in preview", _count(previewed, warn=previewed == 0)
    age_s = now_s - frame.time_s
    fresh = "of the recording" if origin == "recorded" else "live"
    yield (
        "Picture",
        in_colour(f"{words.duration(float(round(age_s)))} old", True, False) if age_s > _LATE_S else fresh,
    )
    text, stale = calibration_age(frame.camera, origin=origin, today=today)
    yield "Calibrated", in_colour(text, stale, False)


def _origin(episode: Episode | None) -> Origin:
    if episode is None or not episode.simulated:
        return "real"
    return "recorded" if episode.rig == "replayed" else "simulated"


def calibration_age(camera: CameraModel, *, origin: Origin, today: date) -> tuple[str, bool]:
    """Age of the calibration, in words, and True where it should be renewed."""
    if origin != "real":
        return {"simulated": "simulated, exact", "recorded": "as it was when this was recorded"}[origin], False
    if not camera.calibrated_at:
        return "never dated", True
    try:
        days = (today - datetime.fromisoformat(camera.calibrated_at).date()).days
    except ValueError:
        return f"on {camera.calibrated_at!r}, which is no day", True
    if days < 0:
        return f"on {camera.calibrated_at}, which is to come", True
    said = "today" if days == 0 else "yesterday" if days == 1 else f"{days} days ago"
    said = f"{said}, checked on {camera.checked_at}" if camera.checked_at else said
    if camera.doubt:
        return f"{said}; {camera.doubt}", True
    return (f"{said}: stale, check it or calibrate again", True) if camera.stale(today) else (said, False)


def clouds(counts: Mapping[str, int]) -> str:
    """Number of drawn points of each cloud."""
    listed = ", ".join(f"{escape(name)}: {_thousands(count)} points" for name, count in counts.items())
    return f'<div class="dp"><small>{listed or "No clouds are drawn."}</small></div>'


def _apart(length_m: float) -> str:
    if not math.isfinite(length_m):
        return words.NOTHING
    return in_colour(f"{_MM * length_m:.1f} mm", length_m > APART_M, False)


def _count(count: int, *, warn: bool) -> str:
    return in_colour(_thousands(count), warn, False)


def _thousands(count: int) -> str:
    return f"{count:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")
