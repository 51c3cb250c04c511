"""The tool paths: every branch of the tree, the proposed one, and the measured path of the last one."""

from typing import final

import numpy as np
import viser

from app.arm.path import SCALE
from app.core.geometry.track import poses_at
from app.core.messages import Proposal
from app.core.motion import Motion
from app.core.types import ToolPose
from app.ui.parts import palette
from app.ui.parts.console_state import ConsoleState

_LIFT_M = 0.004
"""Height of the lines above their paths, so that the table does not hide them."""
_PAUSE_S = 0.8
_SLOWEST_M_S = 1e-3
"""Least drawn speed, so that no motion lasts for ever."""
_NOTHING = np.zeros((0, 2, 3), dtype=np.float32)


@final
class Paths:
    """The lines of one server's scene."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene
        self._visible = True
        self._lines: dict[str, viser.LineSegmentsHandle] = {}

    def paint(self, state: ConsoleState, last: ConsoleState) -> None:
        """Draw branches while they may be decided on, the plan until the next one, and the measured path."""
        if state.pending is not last.pending:
            self._draw_branches(state.pending)
        if state.shown is not last.shown:
            plan = state.shown.motion.positions if state.shown else _NOTHING
            self._draw("plan", segments(plan), np.array(palette.BEST), 5.0)
        if state.executed is not last.executed:
            made = state.executed.made[:, :3] if state.executed else _NOTHING
            self._draw("measured", segments(made), np.array(palette.MEASURED), 3.0)
        if state.pending is not last.pending and state.pending is not None:
            self._erase("measured")

    def show_branches(self, visible: bool) -> None:
        """Draw or hide the branches that were not chosen."""
        self._visible = visible
        if "branches" in self._lines:
            self._lines["branches"].visible = visible

    def _draw_branches(self, proposal: Proposal | None) -> None:
        others = [b for i, b in enumerate(proposal.branches) if i != proposal.best and b.finite] if proposal else []
        if not others:
            self._erase("branches")
            return
        pieces = [segments(branch.tool_path) for branch in others]
        colours = palette.linear(palette.by_cost(np.array([branch.cost_after for branch in others])))
        painted = np.concatenate([np.broadcast_to(c, p.shape) for c, p in zip(colours, pieces, strict=True)])
        self._draw("branches", np.concatenate(pieces), painted, 2.0)
        self._lines["branches"].visible = self._visible

    def _draw(self, name: str, points: np.ndarray, colours: np.ndarray, thickness_px: float) -> None:
        self._erase(name)
        if len(points):
            self._lines[name] = self._scene.add_line_segments(
                f"/paths/{name}", points, colours, thickness=thickness_px, thickness_units="screen"
            )

    def _erase(self, name: str) -> None:
        line = self._lines.pop(name, None)
        if line is not None:
            line.remove()


def along(motion: Motion, elapsed_s: float) -> ToolPose:
    """Tool pose at `elapsed_s` of a motion that is repeated with a pause at its end.

    A turn of the tool takes time as a way does, by the arm's own measure.
    """
    steps_m = np.linalg.norm(np.diff(motion.poses * SCALE, axis=0), axis=1)
    times = np.concatenate([[0.0], np.cumsum(steps_m / np.maximum(motion.speeds[1:], _SLOWEST_M_S))])
    t = elapsed_s % (times[-1] + _PAUSE_S)
    return poses_at(np.array([t]), times, motion.poses)[0]


def segments(path: np.ndarray) -> np.ndarray:
    """The finite pieces of a path `(W, 3)` as line segments, shape (at most W - 1, 2, 3)."""
    if len(path) < 2:
        return _NOTHING
    lifted = np.asarray(path, dtype=np.float32) + np.array([0, 0, _LIFT_M], dtype=np.float32)
    pieces = np.stack([lifted[:-1], lifted[1:]], axis=1)
    return pieces[np.isfinite(pieces).all(axis=(1, 2))]
