"""Shape from silhouettes alone (visual hull, Laurentini 1994), for instants without depth.

The space over the table is cut into voxels. A voxel stays where every informative view shows the object, and at least
one does: a view whose pixel shows the arm, or that does not cover the voxel, is not informative. An object on a table
is assumed no higher than it is wide, which bounds the hull where two cameras leave its height open. Coarse voxels come
first, so that a box of 0.1 m^3 takes milliseconds.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias, final

import cv2
import numpy as np
from jaxtyping import Bool, Float32
from scipy.ndimage import binary_erosion
from scipy.spatial import KDTree

from app.core.geometry.camera import CameraModel
from app.core.types import Cloud
from app.perception.cloud.depth import project
from app.perception.cloud.fuse import Box
from app.perception.cloud.occlusion_memory import CameraObservation
from app.perception.cloud.view_diagnostics import Some

Solid: TypeAlias = Bool[np.ndarray, "a b c"]
Pixels: TypeAlias = Float32[np.ndarray, "height width"]

VOXEL_M = 0.003
_COARSE = 4
"""Voxels along an edge of a coarse one."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Hull:
    """Centres of the hull's voxels [m, world], and those of them that a view shows and that border on the outside."""

    inside: Some
    surface: Some


def hull(sights: Sequence[CameraObservation], box: Box, kept: Float32[np.ndarray, "R 3"], *, at_least: int = 1) -> Hull:
    """The largest body in the box that the silhouettes allow; empty where they agree on nothing.

    `kept`: remembered surface that is hidden from all views: voxels under it stay, too. Fewer than `at_least` voxels
    are divided into eighths until they are as many.
    """
    views = [_silhouette(sight) for sight in sights]
    low, high = np.asarray(box.low), np.asarray(box.high)
    coarse = _grid(low, high, VOXEL_M * _COARSE)
    coarse = coarse[_allowed_mask(coarse, views, VOXEL_M * _COARSE)]
    if not len(coarse):
        return Hull(inside=coarse, surface=coarse)
    offsets = _grid(np.full(3, -VOXEL_M * _COARSE / 2), np.full(3, VOXEL_M * _COARSE / 2), VOXEL_M)
    fine = (coarse[:, None] + offsets).reshape(-1, 3)
    fine = fine[_allowed_mask(fine, views, 0.0) & box.holds(fine)]
    fine = fine[_is_supported(fine, views) | _under(fine, kept)]
    surface, edge_m = fine[_rim(fine) & _is_supported(fine, views)], VOXEL_M
    while 0 < len(fine) < at_least:
        edge_m /= 2
        fine = (fine[:, None] + _grid(np.full(3, -edge_m), np.full(3, edge_m), edge_m)).reshape(-1, 3)
    return Hull(inside=fine, surface=surface)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class _Silhouette:
    """Distance of each pixel from the nearest one that may show the object, and from the nearest that does [pixel]."""

    camera: CameraModel
    to_allowed: Pixels
    to_own: Pixels


def _silhouette(sight: CameraObservation) -> _Silhouette:
    allowed = sight.mask if sight.shadow is None else sight.mask | np.isfinite(sight.shadow)
    return _Silhouette(camera=sight.camera, to_allowed=_away(allowed), to_own=_away(sight.mask))


def _away(mask: Bool[np.ndarray, "height width"]) -> Pixels:
    if not mask.any():
        return np.full(mask.shape, np.inf, np.float32)
    return cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 3)


def _allowed_mask(points: Cloud, views: Sequence[_Silhouette], edge_m: float) -> Bool[np.ndarray, " M"]:
    """Mask of the voxels of this edge that no view excludes; for an edge of 0 their centres count."""
    keep = np.ones(len(points), bool)
    for view in views:
        away, z, inside = _look_up(view.to_allowed, points, view.camera)
        reach = edge_m / 2 * 3**0.5 * view.camera.K[0, 0] / np.where(inside, z, 1.0)
        keep &= ~inside | (away <= reach)
    return keep


def _is_supported(points: Cloud, views: Sequence[_Silhouette]) -> Bool[np.ndarray, " M"]:
    """Mask of the voxels in which some view shows the object."""
    shown = np.zeros(len(points), bool)
    for view in views:
        away, _, inside = _look_up(view.to_own, points, view.camera)
        shown |= inside & (away == 0)
    return shown


def _look_up(image: Pixels, points: Cloud, camera: CameraModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values of the image at the points, their depths [m], and the mask of the points in the image."""
    column, row, z = np.nan_to_num(project(points, camera), nan=-1.0).T
    inside = (z > 0) & (column > -0.5) & (row > -0.5) & (column < camera.width - 0.5) & (row < camera.height - 0.5)
    at = np.rint(np.where(inside, row, 0)).astype(int), np.rint(np.where(inside, column, 0)).astype(int)
    return image[at], z, inside


def _under(points: Cloud, kept: Float32[np.ndarray, "R 3"]) -> Bool[np.ndarray, " M"]:
    """Mask of the voxels beneath a remembered surface."""
    if not len(kept) or not len(points):
        return np.zeros(len(points), bool)
    away, which = KDTree(kept[:, :2]).query(points[:, :2])
    return (away < VOXEL_M) & (points[:, 2] < kept[np.minimum(which, len(kept) - 1), 2] + VOXEL_M / 2)


def _rim(points: Cloud) -> Bool[np.ndarray, " M"]:
    """Mask of the voxels with one of their six neighbours outside."""
    if not len(points):
        return np.zeros(0, bool)
    cells = np.rint((points - points.min(axis=0)) / VOXEL_M).astype(int)
    solid: Solid = np.zeros(cells.max(axis=0) + 1, bool)
    solid[tuple(cells.T)] = True
    return ~binary_erosion(solid)[tuple(cells.T)]


def _grid(low: np.ndarray, high: np.ndarray, edge_m: float) -> Cloud:
    """Centres of the voxels that fill the box from its low corner."""
    axes = [np.arange(a + edge_m / 2, b, edge_m) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float32)
