"""Path progress from the measured tool: an arm follows its path by a clock of its own."""

from typing import final

import numpy as np
from jaxtyping import Float64

from app.arm.path import SCALE, normalize
from app.core.types import ToolPath, ToolPose

_MOVES = SCALE * np.array([1.0] * 7 + [0.0])
"""Weights of a pose's components in path length; fingers that meet something stop short, and do not count."""
_SHORTEST_M, _ABOUT_M, _AHEAD_M = 1e-9, 1e-3, 0.05
"""Shortest segment with a length; tolerance between equally near points; look-ahead along the path [m]."""


@final
class Along:
    """Progress along the path `points (P, 8)`, by the measured tool; monotonic over calls of `advance`.

    `off_m`: distance of the tool from the path [m]. It is measured at the tool, also where the reported point lags
    behind it because the loop ran late and the point advances by one command's length at most.
    """

    def __init__(self, points: ToolPath) -> None:
        self._points, self._moves = points, points * _MOVES
        lengths = np.linalg.norm(np.diff(self._moves, axis=0), axis=1)
        self._at = np.concatenate([[0.0], np.cumsum(lengths)])
        self._come = self._measured = 0.0
        self.off_m = 0.0

    def advance(self, tool: ToolPose, most_m: float, travel_m: float = 0.0) -> ToolPose:
        """Point of the path reached by the measured `tool`, at most `most_m` further than before.

        `travel_m`: distance that it may have moved since the last call.
        """
        self._measured = self._nearest(tool, _AHEAD_M + travel_m)
        self.off_m = float(np.linalg.norm(self._pose(self._measured)[:3] - tool[:3]))
        self._come = min(self._measured, self._come + most_m)
        return self._pose(self._come)

    def _nearest(self, tool: ToolPose, ahead_m: float) -> float:
        """Path length nearest to the tool within the look-ahead; the first of about equally near ones.

        On a path that doubles back the way out counts until the tool is seen to have turned.
        """
        last = self._segment(self._measured + ahead_m)
        places = [self._on(index, tool) for index in range(self._segment(self._measured), last + 1)]
        near_m = min(away for _, away in places) + _ABOUT_M
        return next(come for come, away in places if away <= near_m)

    def _on(self, index: int, tool: ToolPose) -> tuple[float, float]:
        """Nearest path length on a segment, not before the present one, and the tool's distance from it."""
        begin, end = self._moves[index], self._moves[index + 1]
        here, length = _align_sign(tool, self._points[index]) * _MOVES, float(self._at[index + 1] - self._at[index])
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
        return normalize(self._points[index] + share * (self._points[index + 1] - self._points[index]))


def _align_sign(tool: ToolPose, like: ToolPose) -> Float64[np.ndarray, "8"]:
    """The pose with the sign of its quaternion nearer to the path's."""
    return tool if tool[3:7] @ like[3:7] >= 0 else np.concatenate([tool[:3], -tool[3:7], tool[7:]])
