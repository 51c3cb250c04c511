"""LeRobot's normalisation statistics: range, mean, spread and quantiles of each feature, over an episode or all."""

from collections.abc import Mapping, Sequence
from typing import Any, Final, TypeAlias

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from app.recording.exchange.lerobot.depth_image import tiff_depth

Stats: TypeAlias = Mapping[str, list[Any]]
"""Statistics of one feature, as nested lists: `min`, `max`, `mean`, `std` and `q01` to `q99` in its shape, and
`count`."""

_QUANTILES: Final = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
_MOST_IMAGES: Final = 100
_EVERY_PIXEL: Final = 4
"""Stride of the pixels that enter the statistics: the mean needs no more."""


def of_numbers(values: Float[np.ndarray, "S D"]) -> Stats:
    """Statistics of each component over the steps."""
    return _describe(values, len(values))


def of_images(images: Sequence[bytes]) -> Stats:
    """Statistics of red, green and blue in 0..1 over steps and pixels, each of shape (3, 1, 1), as LeRobot expects."""
    chosen = _spread(images)
    return _by_channel(_describe(np.concatenate([_pixels(data) for data in chosen]) / 255.0, len(chosen)))


def of_depth(images: Sequence[bytes]) -> Stats:
    """Statistics of depth over steps and pixels in the files' own unit, each of shape (1, 1, 1), as LeRobot has it."""
    chosen = _spread(images)
    pixels = np.concatenate([tiff_depth(data)[::_EVERY_PIXEL, ::_EVERY_PIXEL].reshape(-1, 1) for data in chosen])
    return _by_channel(_describe(pixels.astype(np.float64), len(chosen)))


def _spread(images: Sequence[bytes]) -> list[bytes]:
    """As many of the images as enter the statistics, spread evenly, each once."""
    chosen = np.unique(np.linspace(0, len(images) - 1, min(len(images), _MOST_IMAGES)).round().astype(int))
    return [images[index] for index in chosen]


def _by_channel(found: Stats) -> Stats:
    """Statistics of channels in the shape of an image, channels first."""
    return {name: value if name == "count" else np.reshape(value, (-1, 1, 1)).tolist() for name, value in found.items()}


def _pixels(jpeg: bytes) -> UInt8[np.ndarray, "P 3"]:
    image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise ValueError("an image cannot be decoded")
    return image[::_EVERY_PIXEL, ::_EVERY_PIXEL, ::-1].reshape(-1, 3)


def _describe(values: Float[np.ndarray, "S D"], count: int) -> Stats:
    quantiles = np.quantile(values, list(_QUANTILES.values()), axis=0)
    return {
        "min": values.min(0).tolist(),
        "max": values.max(0).tolist(),
        "mean": values.mean(0).tolist(),
        "std": values.std(0).tolist(),
        "count": [count],
        **{name: row.tolist() for name, row in zip(_QUANTILES, quantiles, strict=True)},
    }
