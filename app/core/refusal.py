"""Why an arm does not make a motion, by rule: each refusal has one of these codes and a sentence (docs/safety.md)."""

from enum import StrEnum
from typing import final


@final
class Refusal(StrEnum):
    """The rule that was broken. What stands before it in the order of the checks was kept."""

    NOT_SIMULATED = "not-simulated"
    """Automatic approval on a rig that moves something real."""
    STOPPED = "stopped"
    """A stop or a fault is in force."""
    BUSY = "busy"
    """Another motion is being made, or the tool is moved by hand."""
    NOT_APPROVED = "not-approved"
    """The leave is not the approval gate's, or of other numbers."""
    USED = "used"
    """The leave was for one motion, which has been made."""
    SHAPE = "shape"
    """No positions, too many, or other things in another number than positions."""
    NOT_FINITE = "not-finite"
    """Numbers that are none."""
    OUTSIDE = "outside-workspace"
    """The motion or the way to it leaves the workspace box."""
    KEEP_OUT = "keep-out"
    """The motion or the way to it enters a volume that is kept free."""
    SPEED = "speed"
    """Too fast, or no speed at all."""
    TOOL = "tool"
    """A turn that is none, or an opening that the tool does not have."""
    REACH = "out-of-reach"
    """The motion or the way to it goes further than the arm reaches."""
    ELSEWHERE = "elsewhere"
    """The motion continues from where the tool is not."""
    UNREACHABLE = "unreachable"
    """The arm's own controller finds no way for its joints."""
    STUCK = "stuck"
    """The motion does not come to its end."""
    DEVICE = "device"
    """The arm's own controller refuses, for a reason of its own that the sentence repeats."""
