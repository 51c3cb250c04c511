"""The texts of the calibration tab as HTML, and the picture with the board's corners in it. Pure."""

import math
from datetime import date
from html import escape
from typing import Final

import numpy as np
from jaxtyping import UInt8

from app.core.dialogue import words
from app.core.dialogue.camera_calibration_messages import BoardSeen, Placing
from app.core.geometry.camera import STALE_DAYS
from app.core.types import ColourImage
from app.ui.parts import palette
from app.ui.parts.cards import in_colour, table
from app.ui.parts.console_state import ConsoleState
from app.ui.view import overlays

_MM: Final = 1e3
_DOT_PX: Final = 2
_GOOD_TURN_DEG: Final = 10.0
"""Sufficient root mean square of rotations about an axis."""
_PLOT_PX, _PLOT_DEG = 150, 40.0
"""Side of the plot [pixel], and tilt at its border [degree]."""


def live(state: ConsoleState) -> str:
    """Card of the board in the camera's view now, and of the next step."""
    placing = state.placing
    if placing is None or not placing.under_way:
        return (
            '<div class="dp"><small>Fix the printed board in the gripper, choose the camera, give the sizes as '
            "measured, and begin. Views are taken in the modes Idle and By hand.</small></div>"
        )
    seen = _board_text(state.board_seen, placing.camera)
    return f'<div class="dp">{seen}<p role="status">{escape(placing.said)}</p></div>'


def result(placing: Placing | None, today: date) -> str:
    """Card of the views with their residuals, their pose diversity, and the resulting camera pose."""
    if placing is None:
        return ""
    parts = [_camera_table(placing, today)]
    if placing.views:
        parts += [_views(placing), _spread_section(placing)]
    if placing.placed:
        parts.append(_place(placing))
    if len(placing.next_pose):
        parts.append(_next(placing))
    return f'<div class="dp">{"".join(parts)}</div>'


def mark(image: ColourImage, seen: BoardSeen | None) -> UInt8[np.ndarray, "rows columns 3"]:
    """The picture at the panel's size, with a dot on each corner."""
    small, step = overlays.thin_out(image).copy(), overlays.stride(image.shape[1])
    corners = np.rint(seen.corners / step).astype(int) if seen is not None else np.zeros((0, 2), int)
    height, width = small.shape[:2]
    for column, row in corners:
        if 0 <= column < width and 0 <= row < height:
            low = max(row - _DOT_PX + 1, 0), max(column - _DOT_PX + 1, 0)
            small[low[0] : row + _DOT_PX, low[1] : column + _DOT_PX] = palette.MASK
    return small


def _board_text(seen: BoardSeen | None, camera: str) -> str:
    if seen is None or seen.camera != camera:
        return "<p>Waiting for a picture of this camera.</p>"
    if not len(seen.corners):
        return f"<p class='dp-warn'>{escape(seen.why)}</p>"
    return (
        f"<p class='dp-good'>{len(seen.corners)} corners at {seen.distance_m:.2f} m, "
        f"within {seen.error_px:.2f} pixels.</p>"
    )


def _camera_table(placing: Placing, today: date) -> str:
    rows = [("Camera", escape(placing.camera)), ("Calibrated or checked", _age(placing.kept_at, today))]
    for checked in placing.checked:
        text = f"{_MM * checked.moved_m:.1f} mm, {checked.turned_deg:.2f}°"
        rows.append(("Drift", in_colour(text, False, checked.beyond)))
    return table(rows)


def _age(kept_at: str, today: date) -> str:
    """Date of a stored calibration, with a warning where it is old."""
    if not kept_at:
        return in_colour("never kept", True, False)
    try:
        days = (today - date.fromisoformat(kept_at)).days
    except ValueError:
        return in_colour(f"on {escape(repr(kept_at))}, which is no day", True, False)
    return in_colour(
        f"on {escape(kept_at)}{', stale: check it' if days > STALE_DAYS else ''}", days > STALE_DAYS, False
    )


def _views(placing: Placing) -> str:
    rows = ""
    for number, view in enumerate(placing.views, 1):
        if not math.isfinite(view.error_px):
            cells = words.NOTHING
        else:
            cells = f"{view.error_px:.2f} px, {_MM * view.error_m:.2f} mm, {view.error_deg:.2f}°"
        said = in_colour(f"{cells}, left out" if view.outlier else cells, view.outlier, False)
        rows += f"<tr><td>View {number}</td><td>{said}</td></tr>"
    return f"<h3>Views</h3><table>{rows}</table>"


def _spread_section(placing: Placing) -> str:
    told = "".join(
        f"<p>Turned by {_turn(spread.turns_deg[0])} and {_turn(spread.turns_deg[1])} "
        f"about the two main axes, moved by {_MM * spread.shifts_m[0]:.0f} mm.</p>"
        for spread in placing.spread
    )
    return f"<h3>Spread</h3>{told}{_plot(placing)}"


def _turn(turn_deg: float) -> str:
    return in_colour(f"{turn_deg:.0f}°", turn_deg < _GOOD_TURN_DEG, False)


def _plot(placing: Placing) -> str:
    """Plot of the gripper's tilt in each view: a dot for each, about two axes."""
    middle = _PLOT_PX / 2
    dots = ""
    for view in placing.views:
        x, y = (middle * (1 + max(-1.0, min(1.0, tilt / _PLOT_DEG))) for tilt in view.tilt_deg)
        tone = "--dp-warn" if view.outlier else "--dp-good"
        dots += f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" style="fill:var({tone})"/>'
    named = f"Tilts of the views, {_PLOT_DEG:.0f} degrees at the border"
    return (
        f'<svg width="{_PLOT_PX}" height="{_PLOT_PX}" role="img" aria-label="{named}">'
        '<rect width="100%" height="100%" style="fill:var(--dp-fill);stroke:var(--dp-line)"/>'
        f'<path d="M{middle} 0V{_PLOT_PX}M0 {middle}H{_PLOT_PX}" style="stroke:var(--dp-line)"/>{dots}</svg>'
    )


def _place(placing: Placing) -> str:
    found = placing.placed[0]
    x, y, z = _MM * found.pose[:3, 3]
    rows = [
        ("Place", f"{x:.1f}, {y:.1f}, {z:.1f} mm"),
        ("Standard deviation", f"{_MM * max(found.deviation_m):.2f} mm, {max(found.deviation_deg):.3f}°"),
        ("Views miss it by", f"{found.error_px:.2f} px"),
        ("From what is in use", f"{_MM * found.moved_m:.1f} mm, {found.turned_deg:.2f}°"),
    ]
    return f"<h3>Result</h3>{table(rows)}"


def _next(placing: Placing) -> str:
    x, y, z = _MM * placing.next_pose[0, :3]
    return (
        f"<h3>Next</h3><p>The tool to {x:.0f}, {y:.0f}, {z:.0f} mm, turned as the frame in the scene shows: then "
        f"{_MM * placing.promised_m:.2f} mm. <small>Nothing is known here of what is in the way.</small></p>"
    )
