"""Motion commands for an arm's tool."""

import hashlib
from dataclasses import dataclass, field
from typing import final

import numpy as np
from jaxtyping import Float64

from app.core.types import Path3, ToolPath, ToolPose

TOOL_DOWN = (0.0, 1.0, 0.0, 0.0)
"""Default quaternion w x y z of the tool: z down, x along the world's."""


def pointing_down(position: Float64[np.ndarray, "3"]) -> ToolPose:
    """Pose of a closed, unturned tool at `position` [m]."""
    return np.array([*position, *TOOL_DOWN, 0.0])


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """A path of the tool tip: straight lines between `positions`, each approached at its own speed.

    The first position is reached from wherever the arm is, by way of the travel height, and the tool returns to that
    height from the last one. A motion that `continues` begins where the tool is, and ends where it ends.
    `positions [m] (W, 3)`, `speeds [m/s] (W,)`; `turns (W, 4)`, quaternions w x y z, and `openings [m] (W,)` where the
    tool turns or opens on the way: empty where it points down, closed, throughout.
    """

    positions: Path3
    speeds: Float64[np.ndarray, " W"]
    turns: Float64[np.ndarray, "Q 4"] = field(default_factory=lambda: np.zeros((0, 4)))
    openings: Float64[np.ndarray, " G"] = field(default_factory=lambda: np.zeros(0))
    continues: bool = False

    @property
    def poses(self) -> ToolPath:
        """Tool poses at all positions, shape (W, 8)."""
        count = len(self.positions)
        turns = self.turns if len(self.turns) else np.tile(TOOL_DOWN, (count, 1))
        openings = self.openings if len(self.openings) else np.zeros(count)
        return np.concatenate([self.positions, turns, openings[:, None]], axis=1)

    def digest(self) -> str:
        """SHA-256 over the exact numbers: the identity of the motion that the operator saw."""
        digest = hashlib.sha256()
        # Unused fields add nothing, so that motions from before there were turns keep their digests.
        told = [each for each in (self.turns, self.openings, np.array([1.0] * self.continues)) if each.size]
        for array in (self.positions, self.speeds, *told):
            digest.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
        return digest.hexdigest()
