"""Interface of a simulated world: an object and a tool with a prescribed pose. No clock: it is stepped."""

from dataclasses import dataclass
from typing import Protocol, TypeAlias, final

import numpy as np
from jaxtyping import Float64

from app.core.types import ToolPose
from app.rig.simulated.worlds.arm_model import Joints

Nodes: TypeAlias = Float64[np.ndarray, "K 3"]
"""Points [m] that give an object's shape: a rope's centreline, the centres of pieces, or the nodes of a mesh."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Snapshot:
    """The world at one moment, sufficient for a camera. `time_s` is the world's own time."""

    time_s: float
    nodes: Nodes
    tool: ToolPose
    joints: Joints

    @property
    def tip(self) -> Float64[np.ndarray, "3"]:
        """Position of the tool's tip [m]."""
        return self.tool[:3]


class World(Protocol):
    """A deterministic world: the same calls give the same numbers, bit for bit."""

    @property
    def time_s(self) -> float:
        """The world's own time [s]."""
        ...

    @property
    def tool(self) -> ToolPose:
        """Commanded pose of the tool."""
        ...

    def step(self, tool: ToolPose, duration_s: float) -> None:
        """Move the tool in a straight line to the pose `tool` while `duration_s` passes."""
        ...

    def place(self, tool: ToolPose) -> None:
        """Move the tool to `tool` without contact on the way; no time passes."""
        ...

    def nodes(self) -> Nodes:
        """Nodes of the object [m]."""
        ...

    def snapshot(self) -> Snapshot:
        """The state to draw, with the arm's joints solved for the present tool pose."""
        ...
