"""Where on its way a tool is, by where it was measured: an arm goes along by a clock of its own."""

from typing import final

import numpy as np
from jaxtyping import Float64

from app.arm.path import SCALE, whole
from app.core.types import ToolPath, ToolPose

_MOVES = SCALE * np.array([1.0] * 7 + [0.0])
"""Fingers that meet something are never where they should be, and no measure of the way."""
_SHORTEST_M, _ABOUT_M, _AHEAD_M = 1e-9, 1e-3, 0.05
"""Of a segment that is one; of places that are about as near; and how far it is looked ahead."""


@final
class Along:
    """The point of the path `points (P, 8)` that the tool has come to, `advance` by `advance`; never back again.

    `off_m` is how far beside the path the tool is [m], also where the point that was said falls behind it, because who
    looks is late, on a busy machine, and the point goes on by no more than a command's way at a time.
    """

    def __init__(self, points: ToolPath) -> None:
        self._points, self._moves = points, points * _MOVES
        lengths = np.linalg.norm(np.diff(self._moves, axis=0), axis=1)
        self._at = np.concatenate([[0.0], np.cumsum(lengths)])
        self._come = self._measured = 0.0
        self.off_m = 0.0

    def advance(self, tool: ToolPose, most_m: float, travel_m: float = 0.0) -> ToolPose:
        """As far as the measured `tool` is, but no more than `most_m` further than before.

        `travel_m`: how far it may have gone since it was looked at last.
        """
        self._measured = self._nearest(tool, _AHEAD_M + travel_m)
        self.off_m = float(np.linalg.norm(self._pose(self._measured)[:3] - tool[:3]))
        self._come = min(self._measured, self._come + most_m)
        return self._pose(self._come)

    def _nearest(self, tool: ToolPose, ahead_m: float) -> float:
        """How far along the way is nearest to the tool, of what comes next; the first of places that are about as near.

        So on a way that turns back, the way there counts until the tool is seen to have turned.
        """
        last = self._segment(self._measured + ahead_m)
        places = [self._on(index, tool) for index in range(self._segment(self._measured), last + 1)]
        near_m = min(away for _, away in places) + _ABOUT_M
        return next(come for come, away in places if away <= near_m)

    def _on(self, index: int, tool: ToolPose) -> tuple[float, float]:
        """Where on a segment, not before where it is already, the tool is nearest, and how far away from there."""
        begin, end = self._moves[index], self._moves[index + 1]
        here, length = _signed(tool, self._points[index]) * _MOVES, float(self._at[index + 1] - self._at[index])
        ahead = (end - begin) / max(length, _SHORTEST_M)
        first = max(self._measured - float(self._at[index]), 0.0)
        gone = float(np.clip((here - begin) @ ahead, min(first, length), length))
        return float(self._at[index]) + gone, float(np.linalg.norm(begin + gone * ahead - here))

    def _segment(self, come: float) -> int:
        return min(int(np.searchsorted(self._at, come, side="right")) - 1, len(self._points) - 2)

    def _pose(self, come: float) -> ToolPose:
        index = self._segment(come)
        length = float(self._at[index + 1] - self._at[index])
        share = (come - self._at[index]) / length if length > _SHORTEST_M else 1.0
        return whole(self._points[index] + share * (self._points[index + 1] - self._points[index]))


def _signed(tool: ToolPose, like: ToolPose) -> Float64[np.ndarray, "8"]:
    """With the one of a quaternion's two signs that is nearer to the path's."""
    return tool if tool[3:7] @ like[3:7] >= 0 else np.concatenate([tool[:3], -tool[3:7], tool[7:]])
