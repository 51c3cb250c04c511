"""Images of other programs as 8-bit RGB, whatever their depth of colour. Pure."""

import io
from typing import Final

import cv2
import numpy as np
from PIL import Image

from app.core.types import ColourImage

_DEEP_GREY: Final = ("I;16", "I;16L", "I;16B", "I;16N", "I", "F")


def colours_in(data: bytes) -> ColourImage:
    """The pixels of an image file. Raises OSError or ValueError where it is none, or cut off."""
    try:
        with Image.open(io.BytesIO(data)) as image:
            return colours_of(image, data)
    except (SyntaxError, Image.DecompressionBombError) as error:
        raise ValueError(str(error)) from None


def colours_of(image: Image.Image, data: bytes) -> ColourImage:
    """The pixels of the opened `image` of a file that holds `data`. Raises as Pillow does.

    Deeper ones are scaled to their own lightest pixel: sensors of 10 or 12 bits write their numbers into 16.
    """
    raw_modes = " ".join(str(tile) for tile in getattr(image, "tile", ()))
    if image.mode in _DEEP_GREY:
        grey = np.asarray(image, np.float64)
        return np.repeat(_scaled(grey)[..., None], 3, axis=2)
    pixels = np.asarray(image.convert("RGB"))
    # Pillow keeps the upper eight of sixteen bits alone, which are dark where the sensor has twelve.
    deep = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if ";16" in raw_modes else None
    if deep is None or deep.ndim != 3 or deep.shape[2] < 3:
        return pixels
    return _scaled(deep[..., 2::-1].astype(np.float64))


def _scaled(values: np.ndarray) -> np.ndarray:
    """Values from 0 to their greatest as bytes; what is not finite is black."""
    whole = np.where(np.isfinite(values), values, 0.0).clip(0.0)
    return np.round(whole * (255.0 / max(float(whole.max(initial=0.0)), 1.0))).astype(np.uint8)
