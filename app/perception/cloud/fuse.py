"""Fusion of the clouds of several views into one clean surface."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Bool, Float32

from app.core.geometry.camera import CameraModel
from app.core.system.shared_libraries import load_open3d
from app.core.types import Cloud, DepthImage
from app.perception.cloud.depth import nearest, project

Keep: TypeAlias = Bool[np.ndarray, " M"]
"""True for the points to keep."""


@final
@dataclass(frozen=True, kw_only=True)
class Box:
    """An axis-aligned box of the world [m]."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def holds(self, points: Cloud) -> Keep:
        """Mask of the points inside the box."""
        return np.all((points >= np.asarray(self.low)) & (points <= np.asarray(self.high)), axis=1)

    def __str__(self) -> str:
        sides = zip("xyz", self.low, self.high, strict=True)
        return ", ".join(f"{axis} {low:g} to {high:g} m" for axis, low, high in sides)


def not_seen_through(points: Cloud, depth: DepthImage, camera: CameraModel, tolerance_m: float) -> Keep:
    """Mask of the points that another view does not contradict.

    A view contradicts a point where it measures a surface more than `tolerance_m` behind it in that pixel and the eight
    around it: the point would have hidden it. Points outside the image and pixels without a reading contradict nothing.
    """
    column, row, z = project(points, camera).T
    inside = (z > 0) & (column > -0.5) & (row > -0.5) & (column < camera.width - 0.5) & (row < camera.height - 0.5)
    seen_m = np.zeros(len(points))
    pixel = np.rint(row[inside]).astype(int), np.rint(column[inside]).astype(int)
    seen_m[inside] = nearest(depth)[pixel] * camera.depth_unit_m
    return ~(seen_m > np.where(inside, z, 0.0) + tolerance_m) | ~inside


def merge(clouds: Sequence[Float32[np.ndarray, "_ 3"]], voxel_m: float) -> Cloud:
    """One point, the mean, for each voxel of the edge `voxel_m` that holds any: the views weigh the same."""
    points = np.concatenate(clouds)
    voxels = np.floor(points / voxel_m).astype(np.int64)
    voxels -= voxels.min(axis=0)
    _, voxel = np.unique(np.ravel_multi_index(tuple(voxels.T), tuple(voxels.max(axis=0) + 1)), return_inverse=True)
    count = np.bincount(voxel)
    return np.stack([np.bincount(voxel, axis) / count for axis in points.T], axis=1).astype(np.float32)


def without_outliers(points: Cloud, neighbours: int, spread: float) -> Float32[np.ndarray, "kept 3"]:
    """Drop isolated points (statistical outlier removal, Rusu et al. 2008).

    Isolated: the mean distance to its nearest `neighbours` exceeds the mean of that over the cloud by more than
    `spread` standard deviations.
    """
    if len(points) <= neighbours:
        return points
    open3d = load_open3d()
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points.astype(np.float64)))
    _, kept = cloud.remove_statistical_outlier(neighbours + 1, spread)  # It counts the point itself as one.
    return points[np.asarray(kept, int)]
