"""What moves one kind of arm: the drives of a simulated one, or the controller of a real one."""

from typing import Protocol

import numpy as np
from jaxtyping import Float64

from app.core.errors import MotionRefused
from app.core.jog import Jog
from app.core.messages import ArmMode
from app.core.types import ToolPath, ToolPose


class Control(Protocol):
    """The arm between two ticks of its process, which calls all of this from one thread and waits for none of it.

    The gate has checked what `begin` is given; nothing else starts a motion. A stop holds until `reset`.
    """

    @property
    def mode(self) -> ArmMode:
        """What it is doing."""
        ...

    @property
    def reason(self) -> str:
        """Why it is stopped, or has a fault; empty otherwise."""
        ...

    @property
    def commanded(self) -> ToolPose:
        """Where the tool shall be."""
        ...

    @property
    def measured(self) -> ToolPose:
        """Where the tool is."""
        ...

    @property
    def velocity(self) -> Float64[np.ndarray, "3"]:
        """Of the tool's tip, measured [m/s]."""
        ...

    @property
    def joints(self) -> Float64[np.ndarray, "7"]:
        """Joint angles from base to wrist, measured [rad]."""
        ...

    @property
    def force(self) -> Float64[np.ndarray, "3"]:
        """On the tool, in the world frame [N]; NaN where the arm does not measure it."""
        ...

    @property
    def jogging(self) -> bool:
        """Whether it is being moved by hand, or coming to rest from that."""
        ...

    def begin(self, points: ToolPath, speeds: Float64[np.ndarray, " S"]) -> None:
        """Go along `points (P, 8)` from where the tool is, each segment at its speed [m/s].

        Raises MotionRefused, with nothing moved, where the arm has a reason of its own.
        """
        ...

    def refusal(self) -> MotionRefused | None:
        """Why the arm does not make what it was told to by `begin` after all, said once: nothing moved, it is idle."""
        ...

    def jog(self, jog: Jog) -> bool:
        """Move so from now on; whether that was heeded: it is while idle or jogging already, and all is finite."""
        ...

    def coast(self) -> None:
        """Brake to rest where it is jogged, and be idle then: nobody says any more how it shall move."""
        ...

    def stop(self, reason: str) -> None:
        """Brake at the stop deceleration, or stay where it is; the first reason is kept."""
        ...

    def reset(self) -> None:
        """Accept motions again after a stop or a fault; of no effect while the arm moves."""
        ...

    def advance(self, duration_s: float) -> None:
        """Let `duration_s` pass: move, or look at what has moved."""
        ...

    def close(self) -> None:
        """Leave the arm at rest and let go of it."""
        ...
