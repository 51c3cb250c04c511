"""The way of the tool's tip over time, as it was commanded, measured or made."""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64

from app.core.types import Path3, Poses


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ToolTrack:
    """Poses of the tip at increasing times [s]; it rests before the first and after the last."""

    times_s: Float64[np.ndarray, " T"]
    poses: Poses

    @property
    def positions(self) -> Path3:
        """Where the tip is [m]."""
        return self.poses[:, :3]

    @property
    def end_s(self) -> float:
        """When it comes to rest."""
        return float(self.times_s[-1])

    def at(self, times_s: Float64[np.ndarray, " S"]) -> Float64[np.ndarray, "S 3"]:
        """The tip's position at other times [m]."""
        return np.stack([np.interp(times_s, self.times_s, self.poses[:, axis]) for axis in range(3)], axis=1)

    def moved(self, positions: Path3) -> "ToolTrack":
        """The same with its tip elsewhere."""
        return ToolTrack(times_s=self.times_s, poses=np.concatenate([positions, self.poses[:, 3:]], axis=1))
