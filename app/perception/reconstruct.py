"""From RGB-D frames to particles: segment, deproject, fuse, fill, resample."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from jaxtyping import Float32

from app.core.colours import ColourRange, Mask, colour_mask
from app.core.errors import PerceptionError
from app.core.messages import Frame
from app.core.types import Cloud, Points, ToolPose
from app.perception.depth import behind_an_edge, deproject
from app.perception.fill import Solid, Underside, fill, points_inside
from app.perception.fuse import Box, merge, not_seen_through, without_outliers
from app.perception.look import Look, apart_m, thinned
from app.perception.resample import resample
from app.perception.swimming import Swimming
from app.perception.vessels import Pool, Vessel, level_of

_BODY_POINTS = 6000
_POINTS_A_PARTICLE = 8
"""The body is that many points, or that many times the particles: more do not spread the particles better."""
_FEWEST = 30
"""Points that show a pool, or a puddle beside the bowls: fewer are drops."""
_LEAST_SEEN = 0.03
"""Of a pool's surface: what shows less of the surface that stands so high are drops over the rim."""
_LEAST_HIDDEN = 0.01
"""Of a liquid's volume: what is less is error."""
_SPILT_M = 0.02
"""What is spilt is not higher over the table; what is higher, and in no bowl, falls."""
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
    for the table; two standard deviations of the depth, and negative where colour alone tells what lies flat
    on it from it. `edge_step_m`, `see_through_m`: see `depth.behind_an_edge` and
    `fuse.not_seen_through`. Of a liquid, `standing` are the bowls that are fixed, `held` is that in the hand, and
    `volume_m3` is all of it: what is not seen is in the hand, behind a wall. What is `swimming` in it are the last of
    its particles.
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
    standing: tuple[Vessel, ...] = ()
    held: Vessel | None = None
    volume_m3: float = 0.0
    swimming: Swimming | None = None


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Reconstructed:
    """The object as particles of equal volume, and the fused surface that they were made from [m, world].

    `looks`: what each view showed, in the order of the cameras' names.
    """

    positions: Points
    surface: Cloud
    looks: tuple[Look, ...]


def reconstruct(frames: Sequence[Frame], how: Reconstruction, tool: ToolPose | None = None) -> Reconstructed:
    """The object that `frames` show. Their order does not matter. `tool`: where the hand is, if it holds a bowl.

    Raises PerceptionError, naming what each camera saw, where there is no frame or too little of the object in them.
    """
    views, tops = _views(frames, how), _tops(frames, how)
    surface = np.concatenate([_enough(views, how), tops])
    if how.underside == "thin":
        positions = resample(surface, how.particle_count, seed=how.seed)
        return Reconstructed(positions=positions, surface=surface, looks=_told(views))
    pools, rest = _pools(surface, how)
    solids = [_under(rest, how)] if len(rest) >= _FEWEST or not how.standing else []
    if how.held is not None and tool is not None:
        hidden_m3 = how.volume_m3 - sum(body.volume_m3 for body in (*pools, *solids))
        pools += [how.held.at(tool).filled(hidden_m3)] if hidden_m3 > _LEAST_HIDDEN * how.volume_m3 else []
    point_count = max(_BODY_POINTS, _POINTS_A_PARTICLE * how.particle_count)
    spacing_m = (sum(body.volume_m3 for body in (*pools, *solids)) / point_count) ** (1 / 3)
    clouds = [pool.points(spacing_m) for pool in pools] + [points_inside(solid, spacing_m) for solid in solids]
    positions = _particles(np.concatenate(clouds), tops, how)
    return Reconstructed(positions=positions, surface=surface, looks=_told(views))


def looked(frames: Sequence[Frame], how: Reconstruction) -> tuple[Look, ...]:
    """What each view shows, also where that is too little for `reconstruct`."""
    return _told(_views(frames, how))


def _particles(body: Cloud, tops: Float32[np.ndarray, "tops 3"], how: Reconstruction) -> Points:
    """Evenly spread through the body; those of what swims in it come last."""
    if how.swimming is None:
        return resample(body, how.particle_count, seed=how.seed)
    parts = zip(how.swimming.apart(body, tops), how.swimming.split(how.particle_count), strict=True)
    return np.concatenate([resample(part, count, seed=how.seed) for part, count in parts])


def _tops(frames: Sequence[Frame], how: Reconstruction) -> Cloud:
    """What is seen of what swims in the liquid."""
    colours = how.swimming.colours if how.swimming else ()
    clouds = [_surface(_views(frames, replace(how, colour=colour)), how) for colour in colours]
    return np.concatenate([np.zeros((0, 3), np.float32), *clouds])


def _pools(surface: Cloud, how: Reconstruction) -> tuple[list[Pool], Float32[np.ndarray, "rest 3"]]:
    """What stands in the fixed bowls, as high as what is seen of each; and the surface on the table."""
    pools, rest = list[Pool](), surface
    for vessel in how.standing:
        inside = vessel.holds(rest)
        if inside.sum() >= _FEWEST:
            pool = Pool(vessel=vessel, level_m=level_of(rest[inside]))
            if inside.sum() * how.voxel_m**2 >= _LEAST_SEEN * pool.surface_m2:
                pools.append(pool)
        rest = rest[~inside]
    return pools, rest[rest[:, 2] < how.table_m + _SPILT_M] if how.standing else rest


def _under(surface: Cloud, how: Reconstruction) -> Solid:
    return fill(surface, table_m=how.table_m, half_width_m=how.half_width_m, underside=how.underside)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class _View:
    """What one frame shows of the object: how many pixels of its colour, and those of them that lie in the box."""

    frame: Frame
    mask: Mask
    pixel_count: int
    points: Cloud


def _enough(views: Sequence[_View], how: Reconstruction) -> Cloud:
    """The surface that the views agree on, clean. Raises PerceptionError where that is too little."""
    if not views:
        raise PerceptionError("There is no frame to reconstruct from; wait for the cameras or check `dipac doctor`.")
    surface = _surface(views, how)
    if not len(surface):
        raise PerceptionError(_too_little("No view shows the object", views, how))
    if len(surface) < how.min_points:
        raise PerceptionError(
            _too_little(f"The object's surface has {len(surface)} points, {how.min_points} are needed", views, how)
        )
    return surface


def _views(frames: Sequence[Frame], how: Reconstruction) -> list[_View]:
    return [_look(frame, how) for frame in sorted(frames, key=lambda frame: (frame.camera.name, frame.time_s))]


def _surface(views: Sequence[_View], how: Reconstruction) -> Cloud:
    """What the views agree on, without outliers; empty where they show nothing."""
    clouds = [_uncontradicted(view, views, how) for view in views]
    if not any(len(cloud) for cloud in clouds):
        return np.zeros((0, 3), np.float32)
    return without_outliers(merge(clouds, how.voxel_m), _NEIGHBOURS, _SPREAD)


def _look(frame: Frame, how: Reconstruction) -> _View:
    """The object's pixels in one frame, as points in the box and above the table."""
    camera = frame.camera
    mask = colour_mask(frame.color, how.colour)
    points = deproject(frame.depth, mask & ~behind_an_edge(frame.depth, how.edge_step_m, camera), camera)
    keep = how.box.holds(points) & (points[:, 2] >= how.table_m + how.table_margin_m)
    return _View(frame=frame, mask=mask, pixel_count=int(np.count_nonzero(mask)), points=points[keep])


def _told(views: Sequence[_View]) -> tuple[Look, ...]:
    apart = apart_m([view.points for view in views])
    return tuple(
        Look(
            camera=view.frame.camera.name,
            mask=thinned(view.mask),
            pixels=view.pixel_count,
            points=len(view.points),
            apart_m=away_m,
        )
        for view, away_m in zip(views, apart, strict=True)
    )


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
