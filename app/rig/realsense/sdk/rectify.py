"""Rectification: images as a camera without distortion would take them."""

from types import ModuleType
from typing import Any, TypeAlias, final

import cv2
import numpy as np
from jaxtyping import Float32

from app.core.types import ColourImage, DepthImage, Intrinsics

Pixels: TypeAlias = tuple[Float32[np.ndarray, "height width"], Float32[np.ndarray, "height width"]]
"""Source column and row [pixel] of each pixel."""


@final
class Rectifier:
    """Undistorts images of `intrinsics` (the SDK's); the pinhole matrix stays.

    Does nothing where there is no distortion, as most cameras of the D400 series report of their colour.
    """

    def __init__(self, rs: ModuleType, intrinsics: Any) -> None:
        self.K: Intrinsics = pinhole(intrinsics)
        bent = intrinsics.model != rs.distortion.none and any(intrinsics.coeffs)
        self._source = _source(rs, intrinsics, self.K) if bent else None

    def color(self, image: ColourImage) -> ColourImage:
        """Rectified colour image, interpolated; black outside the lens's view."""
        return image if self._source is None else cv2.remap(image, *self._source, cv2.INTER_LINEAR)

    def depth(self, image: DepthImage) -> DepthImage:
        """Rectified depth image by nearest neighbour, never a mean of two readings; 0 outside the lens's view."""
        return image if self._source is None else cv2.remap(image, *self._source, cv2.INTER_NEAREST)


def pinhole(intrinsics: Any) -> Intrinsics:
    """The pinhole matrix [pixel] of the SDK's intrinsics."""
    return np.array([[intrinsics.fx, 0.0, intrinsics.ppx], [0.0, intrinsics.fy, intrinsics.ppy], [0.0, 0.0, 1.0]])


def _source(rs: ModuleType, intrinsics: Any, K: Intrinsics) -> Pixels:
    """Source pixel of each rectified pixel: the SDK's own projection of the pixel's ray."""
    u, v = np.meshgrid(np.arange(intrinsics.width), np.arange(intrinsics.height))
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(K).T
    project = rs.rs2_project_point_to_pixel
    places = np.array([project(intrinsics, ray) for ray in rays.reshape(-1, 3).tolist()], dtype=np.float32)
    return places[:, 0].reshape(u.shape), places[:, 1].reshape(u.shape)
