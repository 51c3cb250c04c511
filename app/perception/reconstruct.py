"""From RGB-D frames to particles: segment, deproject, fuse, fill, resample."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from app.core.errors import PerceptionError
from app.core.messages import Frame
from app.core.types import Cloud, Points
from app.perception.depth import behind_an_edge, deproject
from app.perception.fill import Underside, fill, points_inside
from app.perception.fuse import Box, merge, not_seen_through, without_outliers
from app.perception.resample import resample
from app.perception.segment import ColourRange, colour_mask

_BODY_POINTS = 6000
_POINTS_A_PARTICLE = 8
"""The body is that many points, or that many times the particles: more do not spread the particles better."""
_TABLE = Box(low=(0.20, -0.40, -0.02), high=(0.90, 0.40, 0.20))
"""What the cameras see of the table: the arm's workspace and 5 cm around it."""
_NEIGHBOURS = 8
_SPREAD = 3.0
"""A point of the surface is an outlier beyond so many standard deviations of the distance to so many neighbours."""


@final
@dataclass(frozen=True, kw_only=True)
class Reconstruction:
    """How to see the object: what it looks like, where it can be, and as how many particles.

    `half_width_m`: at least half the width of the object where it is slenderest in the plan, for a rope its radius and
    a little more; less than the distance between strands. `table_margin_m`: what lies lower over the table is taken
    for the table; two standard deviations of the depth. `edge_step_m`, `see_through_m`: see `depth.behind_an_edge` and
    `fuse.not_seen_through`.
    """

    colour: ColourRange
    particle_count: int
    box: Box = _TABLE
    table_m: float = 0.0
    table_margin_m: float = 0.002
    underside: Underside = "round"
    half_width_m: float = 0.010
    voxel_m: float = 0.0015
    edge_step_m: float = 0.008
    see_through_m: float = 0.008
    min_points: int = 200
    seed: int = 0


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Reconstructed:
    """The object as particles of equal volume, and the fused surface that they were made from [m, world]."""

    positions: Points
    surface: Cloud


def reconstruct(frames: Sequence[Frame], how: Reconstruction) -> Reconstructed:
    """The object that `frames` show. Their order does not matter.

    Raises PerceptionError, naming what each camera saw, where there is no frame or too little of the object in them.
    """
    surface = fused_surface(frames, how)
    body = fill(surface, table_m=how.table_m, half_width_m=how.half_width_m, underside=how.underside)
    point_count = max(_BODY_POINTS, _POINTS_A_PARTICLE * how.particle_count)
    inside = points_inside(body, spacing_m=(body.volume_m3 / point_count) ** (1 / 3))
    return Reconstructed(positions=resample(inside, how.particle_count, seed=how.seed), surface=surface)


def fused_surface(frames: Sequence[Frame], how: Reconstruction) -> Cloud:
    """What the views together show of the object's surface, clean; raises as `reconstruct` does."""
    if not frames:
        raise PerceptionError("There is no frame to reconstruct from; wait for the cameras or check `dipac doctor`.")
    views = [_look(frame, how) for frame in sorted(frames, key=lambda frame: (frame.camera.name, frame.time_s))]
    clouds = [_uncontradicted(view, views, how) for view in views]
    if not any(len(cloud) for cloud in clouds):
        raise PerceptionError(_too_little("No view shows the object", views, how))
    surface = without_outliers(merge(clouds, how.voxel_m), _NEIGHBOURS, _SPREAD)
    if len(surface) < how.min_points:
        raise PerceptionError(
            _too_little(f"The object's surface has {len(surface)} points, {how.min_points} are needed", views, how)
        )
    return surface


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class _View:
    """What one frame shows of the object: how many pixels of its colour, and those of them that lie in the box."""

    frame: Frame
    pixel_count: int
    points: Cloud


def _look(frame: Frame, how: Reconstruction) -> _View:
    """The object's pixels in one frame, as points in the box and above the table."""
    camera = frame.camera
    mask = colour_mask(frame.color, how.colour)
    points = deproject(frame.depth, mask & ~behind_an_edge(frame.depth, how.edge_step_m, camera), camera)
    keep = how.box.holds(points) & (points[:, 2] >= how.table_m + how.table_margin_m)
    return _View(frame=frame, pixel_count=int(mask.sum()), points=points[keep])


def _uncontradicted(view: _View, views: Sequence[_View], how: Reconstruction) -> Cloud:
    """The points of `view` that no other view sees through."""
    keep = np.ones(len(view.points), bool)
    for other in views:
        if other is not view:
            keep &= not_seen_through(view.points, other.frame.depth, other.frame.camera, how.see_through_m)
    return view.points[keep]


def _too_little(what: str, views: Sequence[_View], how: Reconstruction) -> str:
    """What is missing, what each camera saw, and what to do."""
    seen = "; ".join(
        f"camera {view.frame.camera.name!r} saw {view.pixel_count} pixels of its colour, "
        f"{len(view.points)} of them with a depth reading inside the box"
        for view in views
    )
    return (
        f"{what}: {seen}. Put the object in the box ({how.box}), free the cameras' view of it, "
        "and check the light against the task's colour range."
    )
