"""Camera intrinsics: pinhole projection and lens distortion."""

from dataclasses import dataclass
from typing import TypeAlias, final

import cv2
import numpy as np
from jaxtyping import Float64

from app.core.types import ColourImage, Intrinsics

Distortion: TypeAlias = tuple[float, float, float, float, float]
"""k1, k2, p1, p2, k3 of Brown's model, as OpenCV orders them."""
STRAIGHT: Distortion = (0.0, 0.0, 0.0, 0.0, 0.0)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Lens:
    """A pinhole with the matrix `K` [pixel] behind a distorting lens of Brown's model."""

    width: int
    height: int
    K: Intrinsics
    distortion: Distortion = STRAIGHT

    @property
    def bend_px(self) -> float:
        """Largest displacement of a pixel on the image's border by distortion [pixel]."""
        u, v = np.meshgrid(np.linspace(0, self.width - 1, 9), np.linspace(0, self.height - 1, 9))
        border = np.stack([u, v], axis=-1)[(u == 0) | (v == 0) | (u == self.width - 1) | (v == self.height - 1)]
        return float(np.linalg.norm(self.ideal(border) - border, axis=1).max())

    def ideal(self, pixels: Float64[np.ndarray, "C 2"] | np.ndarray) -> Float64[np.ndarray, "C 2"]:
        """Undistorted pixels (C, 2) of those observed at `pixels`."""
        if self.distortion == STRAIGHT:
            return np.asarray(pixels, np.float64)
        seen = np.ascontiguousarray(pixels, np.float64).reshape(-1, 1, 2)
        return cv2.undistortPoints(seen, self.K, np.array(self.distortion), P=self.K).reshape(-1, 2)

    def project(self, points: Float64[np.ndarray, "*stack 3"]) -> Float64[np.ndarray, "*stack 2"]:
        """Pinhole projection [pixel] of points [m] in the camera's frame, in front of it."""
        scaled = points @ self.K.T
        return scaled[..., :2] / scaled[..., 2:]

    def undistort(self, image: ColourImage) -> ColourImage:
        """The undistorted image, as the pinhole alone would have taken it; black outside the field of view."""
        return cv2.undistort(image, self.K, np.array(self.distortion)).astype(np.uint8)
