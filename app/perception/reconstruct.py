"""From RGB-D frames to particles: segment, deproject, fuse, remember, fill, resample."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import final

import numpy as np
from jaxtyping import Bool, Float32
from scipy.spatial import KDTree

from app.core.colours import ColourRange
from app.core.errors import PerceptionError
from app.core.geometry.arm_geometry import ArmShape, JointState
from app.core.messages import Frame
from app.core.system.shared_libraries import load_open3d
from app.core.types import Cloud, Points, ToolPath, ToolPose
from app.perception.body.fill import Solid, Underside, fill, points_inside
from app.perception.body.floating_pieces import Swimming
from app.perception.body.occluded_motion import carry_along
from app.perception.body.resample import resample
from app.perception.body.temporal_depth_filter import filter_depth
from app.perception.body.vessels import Pool, Vessel, level_of
from app.perception.cloud.fuse import Box
from app.perception.cloud.hull import Hull, hull
from app.perception.cloud.occlusion_memory import NOTHING, Memory, beside, recall, renew
from app.perception.cloud.robot_mask import pieces, shadow
from app.perception.cloud.view_diagnostics import Some, ViewDiagnostics
from app.perception.cloud.views import ObjectView, PointFilter, diagnostics_of, surface, view
from app.perception.mask.segment import ByColour, Segmenter

_BODY_POINTS = 6000
_POINTS_A_PARTICLE = 8
"""Points of the body, in all and per particle: more do not spread the particles better."""
_FEWEST = 30
"""Fewest points of a pool, or of a puddle beside the bowls: fewer are drops."""
_LEAST_SEEN = 0.03
"""Least visible share of a pool's surface: less at that level is drops over the rim."""
_LEAST_HIDDEN = 0.01
"""Least hidden share of a liquid's volume: less is error."""
_SPILT_M = 0.02
"""Highest spilt liquid over the table; liquid above this, and in no bowl, is falling."""
_NONE: Cloud = np.zeros((0, 3), np.float32)
_TABLE = Box(low=(0.20, -0.40, -0.02), high=(0.90, 0.40, 0.20))
"""Field of view over the table: the arm's workspace and 5 cm around it."""


@final
@dataclass(frozen=True, kw_only=True)
class Reconstruction:
    """Parameters of perception for an object: its appearance, its region, and its number of particles.

    `half_width_m`: at least half the width of the object where it is slenderest in the plan, for a rope its radius and
    a little more; less than the distance between strands. `table_margin_m`: lower points over the table count as table;
    two standard deviations of the depth, and negative where colour alone distinguishes a flat object from it.
    `edge_step_m`, `see_through_m`: see `depth.behind_an_edge` and `fuse.not_seen_through`. For a liquid, `standing` are
    the fixed bowls, `held` is the one in the hand, and `volume_m3` is its total: the unseen part is in the hand, behind
    a wall. Pieces `swimming` in it are the last of its particles. `hidden_s`: time for which hidden points are kept in
    place; 0 for liquids and hanging objects, which move unseen: their own colour then hides the motion, so frames are
    not compared either. `segmenter`: replaces the segmentation by colour. `depth`: use of depth readings; without them,
    and where no frame has any, the shape is the hull of the silhouettes.
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
    hidden_s: float = 60.0
    segmenter: Segmenter | None = None
    depth: bool = True

    @property
    def sieve(self) -> PointFilter:
        """Filter of the depth readings."""
        return PointFilter(
            box=self.box,
            low_m=self.table_m + self.table_margin_m,
            edge_step_m=self.edge_step_m,
            see_through_m=self.see_through_m,
            voxel_m=self.voxel_m,
        )

    @property
    def segmenting(self) -> Segmenter:
        """Segmenter of the object, and then of the pieces swimming in it."""
        swimming = self.swimming.colours if self.swimming else ()
        return self.segmenter or ByColour(ranges=(self.colour, *swimming))


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class PriorKnowledge:
    """Prior knowledge beside the frames: the arm, its configuration at each frame, and earlier observations.

    `postures`: by frame, in the same order; none where unknown. `arm`: None where none is visible. `before`: each
    camera's previous raw frame. `way`: the tool's path since then.
    """

    arm: ArmShape | None = None
    postures: tuple[JointState, ...] = ()
    before: tuple[Frame, ...] = ()
    memory: Memory = NOTHING
    way: ToolPath = field(default_factory=lambda: np.zeros((0, 8)))

    def current_memory(self, how: "Reconstruction") -> Memory:
        """The memory, with the parts that the tool has pushed since moved ahead of it."""
        if self.arm is None:
            return self.memory
        points = carry_along(self.memory.points, self.arm.tool, self.way, 2 * how.half_width_m)
        return replace(self.memory, points=points)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Reconstructed:
    """The object as particles of equal volume, and the fused surface that they were made from [m, world].

    `looks`: diagnostics of each view, in the order of the cameras' names. `predicted`: mask of the particles that no
    camera sees now. `memory`: for the next instant; `expired`: number of its points that were hidden for too long.
    """

    positions: Points
    surface: Cloud
    looks: tuple[ViewDiagnostics, ...]
    predicted: Bool[np.ndarray, " N"]
    memory: Memory
    expired: int = 0


def warm_up() -> None:
    """Load libraries that would delay the first reconstruction."""
    load_open3d()


def reconstruct(
    frames: Sequence[Frame], how: Reconstruction, tool: ToolPose | None = None, known: PriorKnowledge | None = None
) -> Reconstructed:
    """The object in `frames`, whose order does not matter. `tool`: pose of the hand, where it holds a bowl.

    `known` adds hidden parts to the visible ones. Raises PerceptionError, naming each camera's observations, where
    there is no frame or too little of the object in them.
    """
    known = known or PriorKnowledge()
    views, *swimming = _views(frames, how, known)
    now_s = max((frame.time_s for frame in frames), default=0.0)
    past = recall(known.current_memory(how), [view.sight for view in views], how.table_m, since_s=now_s - how.hidden_s)
    if views and not any(view.frame.depth.any() for view in views):
        carved = _carve(views, how, past.kept)
        seen, tops = _enough(carved.surface, views, how), _NONE
    else:
        carved, seen = None, _enough(surface(views, how.sieve), views, how)
        tops = np.concatenate([_NONE, *(surface(each, how.sieve) for each in swimming)])
    kept = beside(past.kept, seen)
    whole = np.concatenate([seen, kept.points, tops])
    body = carved.inside if carved else _body(whole, how, tool)
    positions = _particles(body, tops, how)
    return Reconstructed(
        positions=positions,
        surface=whole,
        looks=diagnostics_of(views),
        predicted=_nearer_to(kept.points, np.concatenate([seen, tops]), positions, how),
        memory=renew(seen, kept, now_s) if how.hidden_s > 0 else NOTHING,
        expired=past.expired,
    )


def diagnose_views(
    frames: Sequence[Frame], how: Reconstruction, known: PriorKnowledge | None = None
) -> tuple[ViewDiagnostics, ...]:
    """Diagnostics of each view, also where they are insufficient for `reconstruct`."""
    return diagnostics_of(_views(frames, how, known or PriorKnowledge())[0])


def _carve(views: Sequence[ObjectView], how: Reconstruction, kept: Memory) -> Hull:
    """Visual hull of the silhouettes. Raises PerceptionError for a liquid: its level is not in its outline."""
    if how.standing:
        raise PerceptionError(
            "No image has depth, and the level of a liquid cannot be told from its outline; check the depth cameras, "
            "and leave out --no-depth for this task."
        )
    low, high = how.box.low, how.box.high
    top = min(high[2], how.table_m + 2 * how.half_width_m) if how.underside == "round" else high[2]
    box = Box(low=(*low[:2], max(low[2], how.table_m)), high=(*high[:2], top))
    return hull([view.sight for view in views], box, kept.points, at_least=how.particle_count)


def _body(surface: Cloud, how: Reconstruction, tool: ToolPose | None) -> Some:
    """Points throughout the body under the surface, or in bowls; for a thin object, its surface."""
    if how.underside == "thin":
        return surface
    pools, rest = _pools(surface, how)
    solids = [_under(rest, how)] if len(rest) >= _FEWEST or not how.standing else []
    if how.held is not None and tool is not None:
        hidden_m3 = how.volume_m3 - sum(body.volume_m3 for body in (*pools, *solids))
        pools += [how.held.at(tool).pool(hidden_m3)] if hidden_m3 > _LEAST_HIDDEN * how.volume_m3 else []
    point_count = max(_BODY_POINTS, _POINTS_A_PARTICLE * how.particle_count)
    spacing_m = (sum(body.volume_m3 for body in (*pools, *solids)) / point_count) ** (1 / 3)
    clouds = [pool.points(spacing_m) for pool in pools] + [points_inside(solid, spacing_m) for solid in solids]
    return np.concatenate(clouds)


def _nearer_to(
    kept: Float32[np.ndarray, "R 3"], seen: Cloud, positions: Points, how: Reconstruction
) -> Bool[np.ndarray, " N"]:
    """Mask of the particles nearer to the kept points than to the seen: in the plan, where they fill a solid."""
    if not len(kept):
        return np.zeros(len(positions), bool)
    axes = 3 if how.underside == "thin" else 2
    to_kept, to_seen = (KDTree(cloud[:, :axes]).query(positions[:, :axes])[0] for cloud in (kept, seen))
    return to_kept < to_seen


def _particles(body: Cloud, tops: Float32[np.ndarray, "tops 3"], how: Reconstruction) -> Points:
    """Particles spread evenly through the body; those of pieces swimming in it come last."""
    if how.swimming is None:
        return resample(body, how.particle_count, seed=how.seed)
    parts = zip(how.swimming.apart(body, tops), how.swimming.split(how.particle_count), strict=True)
    return np.concatenate([resample(part, count, seed=how.seed) for part, count in parts])


def _pools(surface: Cloud, how: Reconstruction) -> tuple[list[Pool], Float32[np.ndarray, "rest 3"]]:
    """Pools in the fixed bowls, at their visible levels; and the surface on the table."""
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


def _enough(seen: Cloud, views: Sequence[ObjectView], how: Reconstruction) -> Cloud:
    """The visible surface. Raises PerceptionError where there is too little of it."""
    if not views:
        raise PerceptionError("There is no frame to reconstruct from; wait for the cameras or check `dipac doctor`.")
    if not len(seen):
        raise PerceptionError(_too_little("No view shows the object", views, how))
    if len(seen) < how.min_points:
        raise PerceptionError(
            _too_little(f"The object's surface has {len(seen)} points, {how.min_points} are needed", views, how)
        )
    return seen


def _views(frames: Sequence[Frame], how: Reconstruction, known: PriorKnowledge) -> list[list[ObjectView]]:
    """The views of the object, then those of each kind that swims in it; each in the order of the cameras' names."""
    postures = known.postures or (None,) * len(frames)
    ordered = sorted(zip(frames, postures, strict=True), key=lambda pair: (pair[0].camera.name, pair[0].time_s))
    before = {frame.camera.name: frame for frame in known.before}
    rows = [_object_views(frame, before.get(frame.camera.name), posture, how, known.arm) for frame, posture in ordered]
    return [list(views) for views in zip(*rows, strict=True)] or [[]]


def _object_views(
    frame: Frame, before: Frame | None, posture: JointState | None, how: Reconstruction, arm: ArmShape | None
) -> list[ObjectView]:
    if not how.depth:
        frame = replace(frame, depth=np.zeros_like(frame.depth))
    elif how.hidden_s > 0:
        frame = filter_depth(frame, before)
    dark = None
    if arm is not None and posture is not None:
        dark = shadow(frame.camera, frame.depth, pieces(arm, posture))
    return [view(frame, mask, dark, how.sieve) for mask in how.segmenting.masks(frame.color)]


def _too_little(what: str, views: Sequence[ObjectView], how: Reconstruction) -> str:
    """Error message: the lack, each camera's observation, and the remedy."""
    seen = "; ".join(
        f"camera {view.frame.camera.name!r} saw {view.pixel_count} pixels of its colour, "
        f"{len(view.points)} of them with a depth reading inside the box"
        for view in views
    )
    return (
        f"{what}: {seen}. Put the object in the box ({how.box}), free the cameras' view of it, "
        "and check the light against the task's colour range."
    )
