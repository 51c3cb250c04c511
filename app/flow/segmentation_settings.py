"""Segmentation settings of the session: the colours in use, which an operator may change, and their masks."""

from collections.abc import Sequence
from dataclasses import replace
from typing import final

import numpy as np

from app.core.colours import ColourRange
from app.core.dialogue.requests import ColourRequest
from app.core.dialogue.segmentation_message import Seen
from app.core.errors import DeviceError, PerceptionError, UsageError
from app.core.messages import Frame, fresh_id
from app.perception.cloud.view_diagnostics import ViewDiagnostics
from app.perception.reconstruct import Reconstructed, Reconstruction

_BEYOND_M = 1.0
"""Margin around the object's box: observations beyond it cannot be of an object."""


def require_placed(frame: Frame) -> Frame:
    """The frame, where its camera stands somewhere. Raises DeviceError where its calibration holds no numbers."""
    camera = frame.camera
    if not (np.isfinite(camera.K).all() and np.isfinite(camera.T_world_camera).all()):
        raise DeviceError(
            f"Nobody knows where camera {camera.name!r} stands: its calibration holds numbers that are not finite; "
            "calibrate it again (`dipac calibration`)."
        )
    return frame


def credible(found: Reconstructed, how: Reconstruction) -> Reconstructed:
    """The reconstruction, if it can be an object. Raises PerceptionError otherwise."""
    x, count = found.positions, how.particle_count
    low, high = np.asarray(how.box.low) - _BEYOND_M, np.asarray(how.box.high) + _BEYOND_M
    if len(x) == count and bool(np.all((x >= low) & (x <= high))):  # No number is no place either.
        return found
    what = f"{len(x)} particles instead of {count}" if len(x) != count else "particles that are nowhere near the table"
    raise PerceptionError(
        f"Perception found {what}; look at the camera images in the console, and start again if this goes on."
    )


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


def seen(frames: Sequence[Frame], looks: Sequence[ViewDiagnostics], how: Reconstruction, *, now_s: float) -> Seen:
    """Message about the frames as segmented with these settings."""
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
