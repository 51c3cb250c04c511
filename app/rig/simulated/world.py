"""What a simulated world is: an object and a tool that goes where it is told. No clock: it steps when told to."""

from dataclasses import dataclass
from typing import Protocol, TypeAlias, final

import numpy as np
from jaxtyping import Float64

from app.core.types import ToolPose
from app.rig.simulated.arm_model import Joints

Nodes: TypeAlias = Float64[np.ndarray, "K 3"]
"""Points [m] that say where an object is: a rope's centreline, or the centres of many pieces, or of a mesh's knots."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Snapshot:
    """The world at one moment: all that a camera needs. `time_s` is the world's own time."""

    time_s: float
    nodes: Nodes
    tool: ToolPose
    joints: Joints

    @property
    def tip(self) -> Float64[np.ndarray, "3"]:
        """Where the tool's tip is [m]."""
        return self.tool[:3]


class World(Protocol):
    """The same calls give the same numbers, bit for bit."""

    @property
    def time_s(self) -> float:
        """The world's own time [s]."""
        ...

    @property
    def tool(self) -> ToolPose:
        """Where the arm has the tool."""
        ...

    def step(self, tool: ToolPose, duration_s: float) -> None:
        """Move the tool in a straight line to the pose `tool` while `duration_s` passes."""
        ...

    def place(self, tool: ToolPose) -> None:
        """Put the tool there without passing anything on the way; no time passes."""
        ...

    def nodes(self) -> Nodes:
        """Where the object is [m]."""
        ...

    def snapshot(self) -> Snapshot:
        """The state to draw, with the arm's joints solved for the present tool pose."""
        ...
