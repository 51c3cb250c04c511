"""Images with the object's segmentation painted in. Pure."""

import numpy as np
from jaxtyping import Bool, UInt8

from app.core.types import ColourImage
from app.ui.parts import palette

_TINT = 0.45
PICTURE_WIDTH = 320


def tint(image: ColourImage, mask: Bool[np.ndarray, "height width"], colour: palette.Colour) -> ColourImage:
    """The image with the masked pixels tinted and their outline drawn, as a copy."""
    painted, ink = image.copy(), np.array(colour, np.float32)
    inside = mask & ~outline(mask)
    painted[inside] = ((1 - _TINT) * image[inside] + _TINT * ink).astype(np.uint8)
    painted[mask & ~inside] = colour
    return painted


def outline(mask: Bool[np.ndarray, "height width"]) -> Bool[np.ndarray, "height width"]:
    """The masked pixels that have a neighbour, of four, which is not; the image's edge counts as none."""
    padded = np.pad(mask, 1, mode="edge")
    within = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    return mask & ~within


def thin_out(image: UInt8[np.ndarray, "height width 3"]) -> UInt8[np.ndarray, "rows columns 3"]:
    """The image thinned to about the width of the panel."""
    step = stride(image.shape[1])
    return np.ascontiguousarray(image[::step, ::step])


def stride(width: int) -> int:
    """Stride that thins an image of this width to the panel's."""
    return max(width // PICTURE_WIDTH, 1)


def enlarge_mask(mask: Bool[np.ndarray, "rows columns"], shape: tuple[int, ...]) -> Bool[np.ndarray, "height width"]:
    """A mask, possibly thinned, enlarged to an image of this shape; empty where it is of another."""
    height, width = shape[:2]
    step = max(-(-width // max(mask.shape[1], 1)), 1)
    spread = np.repeat(np.repeat(mask, step, axis=0), step, axis=1)[:height, :width]
    return spread if spread.shape == (height, width) else np.zeros((height, width), bool)
