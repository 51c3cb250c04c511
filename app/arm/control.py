"""Port to one kind of arm: the drives of a simulated one, or the controller of a real one."""

from typing import Protocol

import numpy as np
from jaxtyping import Float64

from app.core.dialogue.jog import Jog
from app.core.errors import MotionRefused
from app.core.messages import ArmMode
from app.core.types import ToolPath, ToolPose


class Control(Protocol):
    """Control of an arm between two ticks of its process, which makes all calls from one thread; none blocks.

    The gate has checked the arguments of `begin`; nothing else starts a motion. A stop holds until `reset`.
    """

    @property
    def mode(self) -> ArmMode:
        """Mode of the arm."""
        ...

    @property
    def reason(self) -> str:
        """Reason why it is stopped or in fault; empty otherwise."""
        ...

    @property
    def commanded(self) -> ToolPose:
        """Commanded tool pose."""
        ...

    @property
    def measured(self) -> ToolPose:
        """Measured tool pose."""
        ...

    @property
    def velocity(self) -> Float64[np.ndarray, "3"]:
        """Measured velocity of the tool's tip [m/s]."""
        ...

    @property
    def joints(self) -> Float64[np.ndarray, "7"]:
        """Joint angles from base to wrist, measured [rad]."""
        ...

    @property
    def force(self) -> Float64[np.ndarray, "3"]:
        """Force on the tool, in the world frame [N]; NaN where the arm does not measure it."""
        ...

    @property
    def jogging(self) -> bool:
        """True while it is being jogged, or coming to rest from that."""
        ...

    def begin(self, points: ToolPath, speeds: Float64[np.ndarray, " S"]) -> None:
        """Follow `points (P, 8)` from the tool's present pose, each segment at its speed [m/s].

        Raises MotionRefused, with nothing moved, where the arm has a reason of its own.
        """
        ...

    def refusal(self) -> MotionRefused | None:
        """The arm's late refusal of the last `begin`, reported once: nothing moved, and it is idle."""
        ...

    def jog(self, jog: Jog) -> bool:
        """Command a tool velocity; True where it is accepted: while idle or jogging, and with finite numbers."""
        ...

    def decelerate(self) -> None:
        """Brake a jogged arm to rest, and be idle then: its commands have ceased."""
        ...

    def stop(self, reason: str) -> None:
        """Brake at the stop deceleration, or stay at rest; the first reason is kept."""
        ...

    def reset(self) -> None:
        """Accept motions again after a stop or a fault; without effect while the arm moves."""
        ...

    def advance(self, duration_s: float) -> None:
        """Advance by `duration_s`: move, or read the motion of a real arm."""
        ...

    def close(self) -> None:
        """Bring the arm to rest and disconnect."""
        ...
