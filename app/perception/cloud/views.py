"""The object in each frame, and the surface that the frames agree on."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from app.core.colours import Mask
from app.core.messages import Frame
from app.core.types import Cloud
from app.perception.cloud.depth import behind_an_edge, deproject
from app.perception.cloud.fuse import Box, merge, not_seen_through, without_outliers
from app.perception.cloud.occlusion_memory import CameraObservation
from app.perception.cloud.robot_mask import Shadow
from app.perception.cloud.view_diagnostics import ViewDiagnostics, apart_m, thin_out

_NEIGHBOURS = 8
_SPREAD = 3.0
"""Outlier threshold of surface points: standard deviations of the mean distance to so many neighbours."""


@final
@dataclass(frozen=True, kw_only=True)
class PointFilter:
    """Filter of readings: in the box, higher than `low_m`, not behind an edge, and not seen through by another view.

    `edge_step_m`, `see_through_m`: see `depth.behind_an_edge` and `fuse.not_seen_through`.
    """

    box: Box
    low_m: float
    edge_step_m: float
    see_through_m: float
    voxel_m: float


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectView:
    """The object in one frame: its mask without the arm, and its accepted readings."""

    frame: Frame
    mask: Mask
    shadow: Shadow | None
    points: Cloud

    @property
    def sight(self) -> CameraObservation:
        """Its evidence about points of the world."""
        return CameraObservation(self.frame.camera, self.frame.depth, self.mask, self.shadow)

    @property
    def pixel_count(self) -> int:
        """Number of the object's pixels."""
        return int(np.count_nonzero(self.mask))


def view(frame: Frame, mask: Mask, shadow: Shadow | None, sieve: PointFilter) -> ObjectView:
    """The object's pixels in one frame, as points."""
    camera = frame.camera
    if shadow is not None:
        mask = mask & np.isinf(shadow)
    points = deproject(frame.depth, mask & ~behind_an_edge(frame.depth, sieve.edge_step_m, camera), camera)
    keep = sieve.box.holds(points) & (points[:, 2] >= sieve.low_m)
    return ObjectView(frame=frame, mask=mask, shadow=shadow, points=points[keep])


def surface(views: Sequence[ObjectView], sieve: PointFilter) -> Cloud:
    """The surface that the views agree on, without outliers; empty where they show nothing."""
    clouds = [_consistent_points(view, views, sieve) for view in views]
    if not any(len(cloud) for cloud in clouds):
        return np.zeros((0, 3), np.float32)
    return without_outliers(merge(clouds, sieve.voxel_m), _NEIGHBOURS, _SPREAD)


def diagnostics_of(views: Sequence[ObjectView]) -> tuple[ViewDiagnostics, ...]:
    """Diagnostics of each view, for the operator."""
    apart = apart_m([view.points for view in views])
    return tuple(
        ViewDiagnostics(
            camera=view.frame.camera.name,
            mask=thin_out(view.mask),
            pixels=view.pixel_count,
            points=len(view.points),
            apart_m=away_m,
        )
        for view, away_m in zip(views, apart, strict=True)
    )


def _consistent_points(view: ObjectView, views: Sequence[ObjectView], sieve: PointFilter) -> Cloud:
    """The points of `view` that no other view sees through."""
    keep = np.ones(len(view.points), bool)
    for other in views:
        if other is not view:
            keep &= not_seen_through(view.points, other.frame.depth, other.frame.camera, sieve.see_through_m)
    return view.points[keep]
