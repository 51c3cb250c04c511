"""Segmentation of an image: the port, and segmentation by colour, which needs no training."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, final

from app.core.colours import ColourRange, Mask, colour_mask
from app.core.types import ColourImage


class Segmenter(Protocol):
    """Finds objects in a colour image. Equal images give equal masks."""

    def masks(self, color: ColourImage) -> Sequence[Mask]:
        """One mask of the image's size for each object: the task's own first, then each kind that swims in it.

        Raises PerceptionError where it cannot work on this image.
        """
        ...


@final
@dataclass(frozen=True, kw_only=True)
class ByColour:
    """Segmentation by a colour range for each object."""

    ranges: tuple[ColourRange, ...]

    def masks(self, color: ColourImage) -> Sequence[Mask]:
        """A mask for each range."""
        return [colour_mask(color, each) for each in self.ranges]
