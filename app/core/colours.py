"""Colour segmentation of the object: the one rule that perception and the console share."""

import colorsys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from typing import Self, TypeAlias, final

import cv2
import numpy as np
from jaxtyping import Bool

from app.core.bounds import check_range
from app.core.types import ColourImage

Mask: TypeAlias = Bool[np.ndarray, "height width"]
"""True where a pixel belongs to the object."""


@final
@dataclass(frozen=True, kw_only=True)
class ColourRange:
    """A box in hue [degree], saturation and value [0..1].

    Hue is a circle: with `hue_low_deg` above `hue_high_deg` the range passes through red at 0. Raises ParameterError
    where a bound is outside its scale or a lower bound above its upper one.
    """

    hue_low_deg: float
    hue_high_deg: float
    saturation_low: float = 0.35
    saturation_high: float = 1.0
    value_low: float = 0.12
    value_high: float = 1.0

    def __post_init__(self) -> None:
        check_range("hue_low_deg", self.hue_low_deg, 0.0, 360.0)
        check_range("hue_high_deg", self.hue_high_deg, 0.0, 360.0)
        check_range("saturation_low", self.saturation_low, 0.0, 1.0)
        check_range("saturation_high", self.saturation_high, self.saturation_low, 1.0)
        check_range("value_low", self.value_low, 0.0, 1.0)
        check_range("value_high", self.value_high, self.value_low, 1.0)

    @classmethod
    def of(cls, hue_deg: tuple[float, float], saturation: tuple[float, float], value: tuple[float, float]) -> Self:
        """The range from bounds of each, low then high; raises as the constructor does."""
        return cls(
            hue_low_deg=hue_deg[0],
            hue_high_deg=hue_deg[1],
            saturation_low=saturation[0],
            saturation_high=saturation[1],
            value_low=value[0],
            value_high=value[1],
        )

    @property
    def hue_deg(self) -> tuple[float, float]:
        """Bounds of the hue [degree]."""
        return self.hue_low_deg, self.hue_high_deg

    @property
    def saturation(self) -> tuple[float, float]:
        """Bounds of the saturation."""
        return self.saturation_low, self.saturation_high

    @property
    def value(self) -> tuple[float, float]:
        """Bounds of the value."""
        return self.value_low, self.value_high

    @classmethod
    def around(cls, colour: tuple[float, float, float], *, hue_tolerance_deg: float = 18.0) -> Self:
        """The range about an RGB colour in 0..1, from half its saturation up, lit or in shade."""
        hue, saturation, _ = colorsys.rgb_to_hsv(*colour)
        return cls(
            hue_low_deg=(360 * hue - hue_tolerance_deg) % 360,
            hue_high_deg=(360 * hue + hue_tolerance_deg) % 360,
            saturation_low=saturation / 2,
        )


def colour_mask(color: ColourImage, wanted: ColourRange) -> Mask:
    """The pixels whose colour lies in `wanted`, without single specks and with pinholes closed."""
    hsv = cv2.cvtColor(color, cv2.COLOR_RGB2HSV)
    mask = reduce(cv2.bitwise_or, (cv2.inRange(hsv, low, high) for low, high in _bounds(wanted)))
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, cross)
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, cross)
    return mask.astype(bool)


def _bounds(wanted: ColourRange) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Lower and upper bounds in OpenCV's 8-bit HSV, whose hue counts steps of 2 degrees; two pairs across red."""
    low, high = wanted.hue_low_deg, wanted.hue_high_deg
    for hue_low, hue_high in [(low, high)] if low <= high else [(low, 360.0), (0.0, high)]:
        yield (
            np.rint([hue_low / 2, 255 * wanted.saturation_low, 255 * wanted.value_low]),
            np.rint([hue_high / 2, 255 * wanted.saturation_high, 255 * wanted.value_high]),
        )
