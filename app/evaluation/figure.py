"""Figures as files: the same numbers give the same bytes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def save(figure: Figure, path: Path, *, salt: str) -> None:
    """Write an SVG whose text is text; `salt` names its parts apart from those of others on a page."""
    from matplotlib import rc_context  # Takes a second to load, which nobody pays who draws nothing.

    with rc_context({"svg.fonttype": "none", "svg.hashsalt": salt}):
        figure.savefig(path, metadata={"Date": None})
