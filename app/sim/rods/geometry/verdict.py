"""Quality of a centreline: its fit to a cloud as a rod of known length and radius, and its defects."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from app.core.errors import PerceptionError
from app.core.types import Centreline, Points
from app.sim.rods.geometry.centreline import Trace, balance_places, strands_touch, through, trace
from app.sim.rods.geometry.polyline import lengths, places
from app.sim.rods.geometry.rope_cloud import RopeShape

_FEWEST_A_NODE = 2
_LIFTED = 2.6
"""Height over the table, in radii, above which a lying rope of two radii is not seen; noise is a fifth of one."""
_LIFTED_SHARE = 0.02
_BENEATH, _OVER_SHARE = 0.6, 0.1
"""Height in radii of what is lower than a rope can be whose top is at `_LIFTED`, and the share of high points that have
it beneath them where the rope lies over itself."""
_PIECES_APART = 3.0
"""Distance in radii at which points are no neighbours."""
_CRUMB = 0.02
"""Share of the points in a piece that is none: errant ones."""
_LENGTH = 0.12
"""Relative tolerance on the length of the centreline."""
_EXPLAINED = 1.35
"""Distance from the centreline within which a particle is explained, in radii: noise is a fifth of one."""
_UNEXPLAINED = 0.06
_HIDDEN, _HIDDEN_BESIDE = 0.10, 0.02
"""Share of the length without a particle that is not told from a break, and where strands touch: then the order on the
other side of a hole is a guess."""
_AMBIGUOUS = 1.5
"""Margin; see `bench.centrelines` for the rate of wrong orders with less."""
_ENDS_MEET = 2.8


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class CentrelineQuality:
    """Quality of the best centreline through a cloud.

    `residual_m`: root of the mean squared distance of points from it, each as far as it is beyond what a tube explains;
    `unexplained`: share of points outside the tube; `bare`: share of the tube's length without a point; `length_m`:
    found without the known length; `margin`: by how much the best order that is another explains the cloud worse;
    `problems`: one sentence each, the gravest first; none where the centreline can be relied on.
    """

    line: Float64[np.ndarray, "n 2"]
    residual_m: float
    unexplained: float
    bare: float
    length_m: float
    margin: float
    rival: Float64[np.ndarray, "n 2"] | None
    problems: tuple[str, ...]

    def valid_line(self) -> Float64[np.ndarray, "n 2"]:
        """The centreline (n, 2) [m]. Raises PerceptionError with the gravest problem, where there is one."""
        if self.problems:
            raise PerceptionError(self.problems[0])
        return self.line


def doubt(x: Points, rope: RopeShape, near: Centreline | None = None) -> str:
    """The gravest thing that speaks against a planar rod through `x`, in a sentence; empty where nothing does.

    `near`: see `trace`.
    """
    prior = None if near is None or not near.size else near.T.astype(np.float64)
    try:
        assess(x, rope, prior).valid_line()
    except PerceptionError as error:
        return str(error)
    return ""


def assess(x: Points, rope: RopeShape, near: Float64[np.ndarray, "n 2"] | None = None) -> CentrelineQuality:
    """The best centreline through `x`, and what speaks against it. `near`: see `trace`.

    Raises PerceptionError where there is nothing to fit: too few points, or not finite.
    """
    _check_points(x, rope)
    found = trace(x, rope, near)
    along, squared = places(found.line[None], x[:, :2].astype(np.float64))
    beyond = np.clip(np.sqrt(squared[0]) - rope.radius_m, 0.0, None)
    verdict = CentrelineQuality(
        line=found.line,
        residual_m=float(np.sqrt(np.mean(beyond**2))),
        unexplained=float(np.mean(np.sqrt(squared[0]) > _EXPLAINED * rope.radius_m)),
        bare=_bare(along[0], rope),
        length_m=_free_length(found),
        margin=found.margin,
        rival=None if found.rival is None else found.lines[found.rival],
        problems=(),
    )
    return replace(verdict, problems=tuple(_problems(x, rope, verdict)))


def _check_points(x: Points, rope: RopeShape) -> None:
    if len(x) < (fewest := _FEWEST_A_NODE * rope.count):
        raise PerceptionError(
            f"The rope is seen as {len(x)} points, and its rod of {rope.count} nodes needs {fewest}; "
            "reconstruct it as more particles (particle_count)."
        )
    if broken := int((~np.isfinite(x).all(1)).sum()):
        raise PerceptionError(f"{broken} of {len(x)} points of the rope are not finite; look again.")


def _problems(x: Points, rope: RopeShape, verdict: CentrelineQuality) -> Iterator[str]:
    """Sentences, the gravest first."""
    pieces = _pieces(x, rope)
    yield from _off_the_table(x, rope)
    if len(pieces) > 1 and (len(pieces) > 3 or verdict.bare > _HIDDEN or verdict.unexplained > _UNEXPLAINED):
        yield (
            f"The cloud is {len(pieces)} pieces that are {_PIECES_APART * rope.radius_m * 1e3:.0f} mm or more apart, "
            "and no one rope; check the segmentation, or clear the table of what has its colour."
        )
    off = verdict.length_m / rope.length_m - 1
    if abs(off) > _LENGTH:
        word = "longer" if off > 0 else "shorter"
        yield (
            f"The rope is {verdict.length_m:.3f} m long as it is seen, {word} than length_m = {rope.length_m:.3f}; "
            "correct length_m, or free the cameras' view of it."
        )
    if verdict.unexplained > _UNEXPLAINED:
        yield (
            f"{100 * verdict.unexplained:.0f} % of the points are outside of a rope of {rope.length_m:.3f} m and "
            f"radius_m = {rope.radius_m:.4f}; check both, and that one rope alone is seen."
        )
    if crossing(verdict.line):
        yield "The rope crosses itself, which a planar rod cannot; lay its strands apart."
    if verdict.bare > (_HIDDEN_BESIDE if strands_touch(verdict.line, rope) else _HIDDEN):
        yield f"{100 * verdict.bare:.0f} % of the rope's length is not seen; free the cameras' view of it."
    if verdict.margin < _AMBIGUOUS and verdict.rival is not None:
        yield _two_orders(rope, verdict.line, verdict.rival, verdict.margin)


def _two_orders(
    rope: RopeShape, line: Float64[np.ndarray, "n 2"], rival: Float64[np.ndarray, "n 2"], margin: float
) -> str:
    if np.linalg.norm(line[0] - line[-1]) < _ENDS_MEET * rope.radius_m:
        return "The rope's ends touch, and where it begins cannot be told from one cloud; lay the ends apart."
    apart = 1e3 * min(np.linalg.norm(line - each, axis=1).mean() for each in (rival, rival[::-1]))
    return (
        f"Two orders of the rope's strands, {apart:.0f} mm apart, explain the cloud about as well "
        f"(margin {margin:.1f}); give the predicted centreline, or lay the strands apart."
    )


def _off_the_table(x: Points, rope: RopeShape) -> Iterator[str]:
    high = x[:, 2] > _LIFTED * rope.radius_m
    if high.mean() <= _LIFTED_SHARE:
        return
    low = x[x[:, 2] < _BENEATH * rope.radius_m]
    top, lying = 1e3 * x[:, 2].max(), 2e3 * rope.radius_m
    what = f"Points are up to {top:.0f} mm over the table, where a lying rope reaches {lying:.0f}"
    beneath = len(low) > 0 and np.mean(KDTree(low[:, :2]).query(x[high, :2])[0] < rope.radius_m) > _OVER_SHARE
    if beneath:
        yield f"{what}: it lies over itself, which a planar rod cannot; lay its strands apart."
    else:
        yield f"{what}: it is lifted; lay it down, or check the height of the table."


def _pieces(x: Points, rope: RopeShape) -> list[int]:
    """Sizes of pieces of the cloud, seen from above, that are apart."""
    at = x[:, :2].astype(np.float64)
    graph = KDTree(at).sparse_distance_matrix(KDTree(at), _PIECES_APART * rope.radius_m, output_type="coo_matrix")
    _, which = connected_components(graph, directed=False)
    return [size for size in np.bincount(which).tolist() if size > _CRUMB * len(x)]


def _bare(along: Float64[np.ndarray, " N"], rope: RopeShape) -> float:
    """Share of the length without a particle."""
    count = max(8, round(rope.length_m / (1.5 * rope.radius_m)))
    return float(np.mean(np.histogram(along, count, (0, rope.count - 1))[0] == 0))


def _free_length(found: Trace) -> float:
    """Length [m] of the smooth line through the points in the best order, whatever is known of it."""
    line, rope, cloud = found.line - found.cloud.origin, found.rope, found.cloud
    along = balance_places(places(line[None], cloud.at)[0], cloud.share, rope, 1.0)
    return float(lengths(through(along, cloud, rope.count, 1.0))[0])


def crossing(line: Float64[np.ndarray, "n 2"]) -> bool:
    """True where any two segments of a line cross."""
    return len(crossings(line)) > 0


def crossings(line: Float64[np.ndarray, "n 2"]) -> Int64[np.ndarray, "K 2"]:
    """The pairs of segments of a line that cross, the first before the second along it."""
    start, edge = line[:-1], np.diff(line, axis=0)
    between = start[None] - start[:, None]

    def cross(a: Float64[np.ndarray, "... 2"], b: Float64[np.ndarray, "... 2"]) -> Float64[np.ndarray, "..."]:
        return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]

    slant = cross(edge[:, None], edge[None])
    safe = np.where(np.abs(slant) < 1e-12, np.inf, slant)
    here, there = cross(between, edge[None]) / safe, cross(between, edge[:, None]) / safe
    inside = (here > 0) & (here < 1) & (there > 0) & (there < 1)
    first, second = np.indices(slant.shape)
    return np.argwhere(inside & (second - first > 1))
