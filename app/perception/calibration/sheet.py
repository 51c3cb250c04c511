"""A board on paper at true scale, as PDF, SVG or PNG."""

from collections.abc import Mapping
from io import BytesIO
from typing import Any, Final, Literal, TypeAlias

import numpy as np
from jaxtyping import Bool
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from app.core.geometry.charuco import DICTIONARIES, Charuco
from app.perception.calibration.sight import opencv_board

Format: TypeAlias = Literal["pdf", "svg", "png"]
FORMATS: Final[Mapping[str, Format]] = {".pdf": "pdf", ".svg": "svg", ".png": "png"}
"""Output formats by file name suffix."""

DPI: Final = 600
_INCH_M = 0.0254
_MARGIN_M, _FOOT_M = 0.010, 0.010
_RULER_M = 0.100
_SCALE_TEXT: Final = "100 mm when printed at 100 %: measure it"


def size_m(board: Charuco) -> tuple[float, float]:
    """Width and height [m] of the sheet: the board, a margin, and a line below with a ruler."""
    width, height = board.size_m
    return max(width, _RULER_M) + 2 * _MARGIN_M, height + 2 * _MARGIN_M + _FOOT_M


def sheet(board: Charuco, kind: Format) -> bytes:
    """The file's bytes. PNG has 600 dots an inch, and its metadata say so."""
    width, height = size_m(board)
    figure = Figure(figsize=(width / _INCH_M, height / _INCH_M), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, width), ylim=(height, 0))
    axes.set_axis_off()
    for x, y, side in _black(board):
        axes.add_patch(Rectangle((x + _MARGIN_M, y + _MARGIN_M), side, side, color="black", lw=0, antialiased=False))
    _foot(axes, board, height)
    written = BytesIO()
    # Without date and random ids, so that the same board gives the same file.
    when: dict[str, Any] = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {}}[kind]
    with rc_context({"svg.hashsalt": "dipac"}):
        figure.savefig(written, format=kind, dpi=DPI, metadata=when)
    return written.getvalue()


def _black(board: Charuco) -> list[tuple[float, float, float]]:
    """Every black square and black cell of a marker: left, top and side [m], on the board."""
    s, found = board.square_m, list[tuple[float, float, float]]()
    markers = iter(_markers(board))
    for row in range(board.rows):
        for column in range(board.columns):
            if (row + column) % 2 == 0:
                found.append((column * s, row * s, s))
                continue
            cells = next(markers)
            side, inset = board.marker_m / len(cells), (s - board.marker_m) / 2
            found += [
                (column * s + inset + j * side, row * s + inset + i * side, side)
                for i, j in np.argwhere(cells).tolist()
            ]
    return found


def _markers(board: Charuco) -> list[Bool[np.ndarray, "n n"]]:
    """The cells of each marker with its border, in order: True where one is black."""
    made = opencv_board(board)
    cells = DICTIONARIES[board.dictionary] + 2
    return [made.getDictionary().generateImageMarker(int(number), cells) == 0 for number in made.getIds()]


def _foot(axes: Any, board: Charuco, height: float) -> None:
    """Draw a ruler and the board's description."""
    y, x = height - _MARGIN_M * 0.8, _MARGIN_M
    axes.plot([x, x + _RULER_M], [y, y], color="black", lw=0.6)
    for end in (x, x + _RULER_M):
        axes.plot([end, end], [y - 0.0015, y + 0.0015], color="black", lw=0.6)
    axes.text(x, y - 0.003, f"{_SCALE_TEXT}. dipac board: {board}", fontsize=6, family="sans-serif", va="baseline")
