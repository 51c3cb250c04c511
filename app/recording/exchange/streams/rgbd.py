"""Images of other programs as frames: undistorted, and the depth at the pixels of the colours. Pure."""

from dataclasses import dataclass, replace
from typing import Any, Final, final

import cv2
import numpy as np
from jaxtyping import Float64

from app.core.geometry.camera import CameraModel
from app.core.messages import Frame, fresh_id
from app.core.types import Cloud, ColourImage, DepthImage, Intrinsics, Transform

MM_M: Final = 0.001
"""Unit of depth images in millimetres [m]."""
_FINE_M: Final = 0.0001
"""Unit of depth that is told in parts of a millimetre [m]: finer than what any depth camera of a table resolves."""
_DEEPEST: Final = 65535


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Pinhole:
    """Intrinsics of an image: matrix, and coefficients of its distortion in OpenCV's order (none: undistorted)."""

    width: int
    height: int
    K: Intrinsics
    distortion: tuple[float, ...] = ()

    @property
    def is_straight(self) -> bool:
        """True without distortion."""
        return not any(self.distortion)

    def at_size(self, width: int, height: int) -> "Pinhole":
        """The same optics at another resolution."""
        across, along = width / self.width, height / self.height
        K = self.K * np.array([[across], [along], [1.0]])
        K[:2, 2] += 0.5 * np.array([across, along]) - 0.5  # Pixels count from the centre of the first.
        return Pinhole(width=width, height=height, K=K, distortion=self.distortion)

    def undistort(self, image: np.ndarray, *, nearest: bool) -> Any:
        """The undistorted image; `nearest`: without mixing pixels."""
        if self.is_straight:
            return image
        maps = cv2.initUndistortRectifyMap(
            self.K, np.array(self.distortion), np.eye(3), self.K, (self.width, self.height), cv2.CV_32FC1
        )
        return cv2.remap(image, *maps, cv2.INTER_NEAREST if nearest else cv2.INTER_LINEAR)


def millimetres(depth: Float64[np.ndarray, "height width"] | np.ndarray) -> DepthImage:
    """Depth in metres as a depth image of the unit `MM_M`; what is not finite, negative or too far has no reading."""
    return _steps(np.asarray(depth, np.float64), MM_M)


def depth_steps(depth: Float64[np.ndarray, "height width"]) -> tuple[DepthImage, float]:
    """Depth in metres as a depth image and its unit [m]: tenths of a millimetre where it has parts of one, and fits."""
    read = depth[np.isfinite(depth) & (depth > 0)] / MM_M
    is_whole = bool(np.all(np.abs(read - np.round(read)) < _WHOLE))
    unit_m = MM_M if is_whole or float(read.max()) * MM_M > _DEEPEST * _FINE_M else _FINE_M
    return _steps(depth, unit_m), unit_m


_WHOLE: Final = 1e-3
"""Tolerance of a whole millimetre [mm]: 32 bits round metres by less."""


def _steps(depth: Float64[np.ndarray, "height width"] | np.ndarray, unit_m: float) -> DepthImage:
    steps = np.round(depth / unit_m)
    return np.where(np.isfinite(steps) & (steps > 0) & (steps <= _DEEPEST), steps, 0).astype(np.uint16)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class RgbdPair:
    """Images of one moment, the depth in steps of `unit_m`; `depth` None where there is none.

    `T_color_depth`: pose of the depth camera in the colour camera's frame; None where depth is aligned to colour.
    """

    name: str
    time_s: float
    color: ColourImage
    optics: Pinhole
    T_world_color: Transform
    depth: DepthImage | None = None
    depth_optics: Pinhole | None = None
    T_color_depth: Transform | None = None
    unit_m: float = MM_M

    def with_depth(
        self, depth: DepthImage, unit_m: float, optics: Pinhole | None = None, T_color_depth: Transform | None = None
    ) -> "RgbdPair":
        """The pair with this depth, in steps of `unit_m`."""
        return replace(self, depth=depth, unit_m=unit_m, depth_optics=optics, T_color_depth=T_color_depth)

    def frame(self) -> Frame:
        """The pair as a frame; where depth is not aligned, in the depth camera's pixels, with the colours seen there.

        No reading is invented or lost; where something hides a place from the colour camera, the colour is that of it.
        """
        color = self.optics.undistort(self.color, nearest=False)
        if self.depth is None:
            return self._frame(color, np.zeros(color.shape[:2], np.uint16), self.optics, self.T_world_color)
        if self.T_color_depth is None or self.depth_optics is None:
            return self._frame(color, self.optics.undistort(self.depth, nearest=True), self.optics, self.T_world_color)
        depth = self.depth_optics.undistort(self.depth, nearest=True)
        seen = self._colours_at(color, depth, self.depth_optics, self.T_color_depth)
        return self._frame(seen, depth, self.depth_optics, self.T_world_color @ self.T_color_depth)

    def _frame(self, color: ColourImage, depth: DepthImage, optics: Pinhole, pose: Transform) -> Frame:
        height, width = depth.shape
        return Frame(
            id=fresh_id("frame"),
            time_s=self.time_s,
            camera=CameraModel(
                name=self.name,
                width=width,
                height=height,
                K=np.asarray(optics.K, np.float64),
                T_world_camera=pose,
                depth_unit_m=self.unit_m,
            ),
            color=np.ascontiguousarray(color),
            depth=np.ascontiguousarray(depth),
        )

    def _colours_at(self, color: ColourImage, depth: DepthImage, optics: Pinhole, T: Transform) -> ColourImage:
        """Colour at each pixel that has a reading; black elsewhere."""
        rows, columns = np.nonzero(depth)
        z = depth[rows, columns] * self.unit_m
        rays = np.linalg.inv(optics.K) @ np.stack([columns, rows, np.ones(len(rows))])
        points = T[:3, :3] @ (rays * z) + T[:3, 3:]
        seen = self.optics.K @ points
        ahead = seen[2] > 0
        u, v = (np.round(np.divide(seen[axis], seen[2], out=np.full(len(z), -1.0), where=ahead)) for axis in (0, 1))
        inside = ahead & (u >= 0) & (v >= 0) & (u < self.optics.width) & (v < self.optics.height)
        found = np.zeros((*depth.shape, 3), np.uint8)
        found[rows[inside], columns[inside]] = color[v[inside].astype(int), u[inside].astype(int)]
        return found


@final
class DepthUnits:
    """Units of depth of several cameras, one each, for images of which some have parts of a millimetre and some not."""

    def __init__(self) -> None:
        self._told = dict[str, set[float]]()
        self._farthest_m = dict[str, float]()

    def add(self, frame: Frame) -> None:
        """Take a frame into account."""
        name, unit_m = frame.camera.name, frame.camera.depth_unit_m
        self._told.setdefault(name, set()).add(unit_m)
        self._farthest_m[name] = max(self._farthest_m.get(name, 0.0), float(frame.depth.max(initial=0)) * unit_m)

    def in_unit(self, frame: Frame) -> Frame:
        """A frame that was added, in its camera's unit: the finest that was told and reaches, or else the coarsest."""
        name, own_m = frame.camera.name, frame.camera.depth_unit_m
        finest_m, coarsest_m = min(self._told[name]), max(self._told[name])
        unit_m = finest_m if self._farthest_m[name] <= _DEEPEST * finest_m else coarsest_m
        if unit_m == own_m:
            return frame
        depth = _steps(frame.depth.astype(np.float64) * own_m, unit_m)
        return replace(frame, camera=replace(frame.camera, depth_unit_m=unit_m), depth=depth)


def transform_points(points: Cloud, T: Transform) -> Cloud:
    """The points in the frame that `T` maps to."""
    return (points @ T[:3, :3].T + T[:3, 3]).astype(np.float32)
