"""What a browser says thirty times a second while something is held. Read strictly: it comes from outside."""

from typing import Annotated, Literal, TypeAlias, final

import msgspec
from msgspec import Meta

from app.core.errors import ParameterError

Deflection: TypeAlias = Annotated[float, Meta(ge=-1, le=1)]
Count: TypeAlias = Annotated[int, Meta(ge=0, le=2**40)]
FrameName: TypeAlias = Literal["world", "tool"]
"""Along the axes of the world, or as the tool has turned from pointing straight down."""


@final
class Axes(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How far each axis is deflected: x, y, z; `yaw` about z; `grip` is positive where it opens."""

    x: Deflection = 0.0
    y: Deflection = 0.0
    z: Deflection = 0.0
    yaw: Deflection = 0.0
    grip: Deflection = 0.0


@final
class Sample(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What is held at one moment.

    `held`: whether anything is, a gamepad's dead-man button too; `pressed` numbers the presses of a page and `sequence`
    its samples; `speed` is the share of the arm's speed limit; `towards`: not along the axes but to the aim.
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
    """What was said. Raises ParameterError where it makes no sense, has a number out of its range, or says more."""
    try:
        return _decoder.decode(data)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise ParameterError(f"A sample of what is held makes no sense: {error}.") from None
