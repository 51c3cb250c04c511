"""Occlusion memory: hidden parts of the object stay where they were last seen, until an image contradicts them.

The surface of the object is remembered from instant to instant. A point that no camera sees now is kept while something
else is in front of it (the arm, a hand), and is dropped as soon as one camera sees through its position, or another
colour there. So nothing is remembered that any image contradicts.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias, final

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Float64
from scipy.spatial import KDTree

from app.core.colours import Mask
from app.core.geometry.camera import CameraModel
from app.core.types import Cloud, DepthImage
from app.perception.cloud.depth import nearest, project
from app.perception.cloud.robot_mask import Shadow

Which: TypeAlias = Bool[np.ndarray, " M"]

FREE_M = 0.004
"""Depth difference of a reading behind a point: three standard deviations of a D400's depth at 0.75 m."""
_FRONT_M = 0.008
"""Depth difference of a reading that occludes a point: as for `Reconstruction.see_through_m`, extrinsics err too."""
_LOW_M = 0.006
"""Height over the table below which depth does not distinguish points from the table; colour alone does."""
_REPRESENTED_M = 0.004
"""Distance to a point that is seen now within which a remembered point is redundant."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Memory:
    """Points of the object's surface [m, world], and the time each was last seen [s]."""

    points: Float32[np.ndarray, "R 3"]
    seen_s: Float64[np.ndarray, " R"]


NOTHING = Memory(points=np.zeros((0, 3), np.float32), seen_s=np.zeros(0))


class CameraObservation(NamedTuple):
    """Evidence of one image: `mask` of the object, and `shadow` of the arm, where that is known."""

    camera: CameraModel
    depth: DepthImage
    mask: Mask
    shadow: Shadow | None


class Recalled(NamedTuple):
    """The part of a memory that is kept, and the number of points dropped because they were hidden for too long."""

    kept: Memory
    expired: int


def recall(memory: Memory, sights: Sequence[CameraObservation], table_m: float, *, since_s: float) -> Recalled:
    """The part of `memory` that is hidden now and was seen after `since_s` [s]."""
    keeps, goes = np.zeros(len(memory.points), bool), np.zeros(len(memory.points), bool)
    for sight in sights:
        hidden, answered = _judge(memory.points, sight, table_m)
        keeps |= hidden
        goes |= answered
    hidden, young = keeps & ~goes, memory.seen_s >= since_s
    kept = Memory(points=memory.points[hidden & young], seen_s=memory.seen_s[hidden & young])
    return Recalled(kept, int(np.count_nonzero(hidden & ~young)))


def beside(kept: Memory, seen: Cloud) -> Memory:
    """Remembered points without those that are also seen."""
    if not len(kept.points) or not len(seen):
        return kept
    away = KDTree(seen).query(kept.points, distance_upper_bound=_REPRESENTED_M)[0]
    apart = ~np.isfinite(away)
    return Memory(points=kept.points[apart], seen_s=kept.seen_s[apart])


def renew(seen: Cloud, kept: Memory, now_s: float) -> Memory:
    """Memory of the points seen now and those kept."""
    return Memory(
        points=np.concatenate([seen, kept.points]),
        seen_s=np.concatenate([np.full(len(seen), now_s), kept.seen_s]),
    )


def _judge(points: Float32[np.ndarray, "R 3"], sight: CameraObservation, table_m: float) -> tuple[Which, Which]:
    """Masks of the points that this image hides, and of those that it locates or contradicts.

    Neither holds for points outside the image and those that the object itself hides: it may have moved over them.
    """
    column, row, z = np.nan_to_num(project(points, sight.camera), nan=-1.0).T
    camera = sight.camera
    inside = (z > 0) & (column > -0.5) & (row > -0.5) & (column < camera.width - 0.5) & (row < camera.height - 0.5)
    at = np.rint(np.where(inside, row, 0)).astype(int), np.rint(np.where(inside, column, 0)).astype(int)
    around = cv2.dilate(sight.mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    own, measured_m = around[at], nearest(sight.depth)[at] * camera.depth_unit_m
    arm = np.zeros(len(points), bool) if sight.shadow is None else sight.shadow[at] < z
    if not sight.depth.any():
        return inside & arm, inside & ~arm
    there = measured_m > 0
    ahead, behind = there & (measured_m < z - _FRONT_M), measured_m > z + FREE_M
    # A point with the same depth as before and another colour: the light has changed, not the object.
    relit = there & ~own & ~ahead & ~behind & (points[:, 2] > table_m + _LOW_M)
    hidden = arm | (ahead & ~own) | (own & ~there) | relit
    answered = ~hidden & ~(ahead & own) & (there | own)
    return inside & hidden, inside & answered
