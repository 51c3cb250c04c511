"""Samples that a browser sends thirty times a second while a control is held. Parsed strictly: they are untrusted."""

from typing import Annotated, Literal, TypeAlias, final

import msgspec
from msgspec import Meta

from app.core.errors import ParameterError

Deflection: TypeAlias = Annotated[float, Meta(ge=-1, le=1)]
Count: TypeAlias = Annotated[int, Meta(ge=0, le=2**40)]
FrameName: TypeAlias = Literal["world", "tool"]
"""Frame of the axes: the world's, or rotated as the tool is from pointing straight down."""


@final
class Axes(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Deflection of each axis: x, y, z; `yaw` about z; `grip` is positive where it opens."""

    x: Deflection = 0.0
    y: Deflection = 0.0
    z: Deflection = 0.0
    yaw: Deflection = 0.0
    grip: Deflection = 0.0


@final
class Sample(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """State of the controls at one moment.

    `held`: True while any is held, a gamepad's dead-man button too; `pressed` numbers the presses of a page and
    `sequence` its samples; `speed` is the share of the arm's speed limit; `towards`: go to the target, not along the
    axes.
    """

    axes: Axes = Axes()
    held: bool
    pressed: Count
    sequence: Count
    speed: Annotated[float, Meta(ge=0, le=1)]
    frame: FrameName = "world"
    towards: bool = False


_decoder = msgspec.json.Decoder(Sample)


def read_sample(data: bytes) -> Sample:
    """Parsed sample. Raises ParameterError where it is malformed, has a number out of range, or unknown fields."""
    try:
        return _decoder.decode(data)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise ParameterError(f"A sample of what is held makes no sense: {error}.") from None
