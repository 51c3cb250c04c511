"""Codes of refused motions: each refusal has one of them and a sentence (docs/safety.md)."""

from enum import StrEnum
from typing import final


@final
class Refusal(StrEnum):
    """The rule that was violated. Rules before it in the order of the checks were satisfied."""

    NOT_SIMULATED = "not-simulated"
    """Automatic approval on a rig that moves something real."""
    STOPPED = "stopped"
    """A stop or a fault is in force."""
    BUSY = "busy"
    """Another motion is under way, or the tool is being jogged."""
    NOT_APPROVED = "not-approved"
    """The approval is not the gate's, or its numbers differ from the motion's."""
    USED = "used"
    """The approval was for one motion, which has been executed."""
    SHAPE = "shape"
    """No positions, too many, or speeds, turns or openings that do not match them in number."""
    NOT_FINITE = "not-finite"
    """NaN or infinite numbers."""
    OUTSIDE = "outside-workspace"
    """The motion or the approach to it leaves the workspace box."""
    KEEP_OUT = "keep-out"
    """The motion or the approach to it enters a keep-out volume."""
    SPEED = "speed"
    """Too fast, or no speed at all."""
    TOOL = "tool"
    """An invalid quaternion, or an opening that the tool does not have."""
    REACH = "out-of-reach"
    """The motion or the approach to it goes further than the arm reaches."""
    ELSEWHERE = "elsewhere"
    """The motion continues from a pose that is not the tool's."""
    UNREACHABLE = "unreachable"
    """The arm's own controller finds no joint path."""
    STUCK = "stuck"
    """The motion does not reach its end."""
    DEVICE = "device"
    """The arm's own controller refuses, for a reason of its own that the sentence repeats."""
