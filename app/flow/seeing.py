"""How the object is seen in this session: the colours in use, which an operator may change, and what they show."""

from collections.abc import Sequence
from dataclasses import replace
from typing import final

import numpy as np

from app.core.colours import ColourRange
from app.core.errors import UsageError
from app.core.messages import Frame, fresh_id
from app.core.requests import ColourRequest
from app.core.seeing import Seen
from app.perception.look import Look
from app.perception.reconstruct import Reconstruction


@final
class Seeing:
    """Holds `how` to reconstruct. What was begun before a change is of the former colours."""

    def __init__(self, how: Reconstruction) -> None:
        self.how = how

    def recolour(self, request: ColourRequest) -> str:
        """Look for these colours from now on; returns what was done, in words.

        Raises ParameterError where they make no range, and UsageError where no colours are looked for; nothing is
        changed then.
        """
        colour = ColourRange.of(request.hue_deg, request.saturation, request.value)
        if self.how.segmenter is not None:
            raise UsageError("A trained segmenter finds the object (--segmenter), whatever its colours.")
        self.how = replace(self.how, colour=colour)
        hue, saturation, value = colour.hue_deg, colour.saturation, colour.value
        return (
            f"{request.operator} set the object's colours: hue {hue[0]:.0f} to {hue[1]:.0f} degrees, saturation "
            f"{saturation[0]:.2f} to {saturation[1]:.2f}, value {value[0]:.2f} to {value[1]:.2f}."
        )


def seen(frames: Sequence[Frame], looks: Sequence[Look], how: Reconstruction, *, now_s: float) -> Seen:
    """What the frames showed when they were looked at in this way."""
    return Seen(
        id=fresh_id("seen"),
        cause=tuple(frame.id for frame in frames),
        time_s=now_s,
        masks={look.camera: look.mask for look in looks},
        pixels={look.camera: look.pixels for look in looks},
        points={look.camera: look.points for look in looks},
        hue_deg=how.colour.hue_deg,
        saturation=how.colour.saturation,
        value=how.colour.value,
        apart_m={look.camera: look.apart_m for look in looks if np.isfinite(look.apart_m)},
    )
