"""Centreline of a rope that lies on the table, from unordered points: hypotheses of the order, each fitted and scored.

Where strands touch, neighbours of a point are on other strands too, and no local rule tells the order. Many orders are
therefore tried (`orders`), a rod of the known length is fitted to each, and the one is taken that explains the cloud
best as an evenly filled tube. Balanced assignment: particles stand for equal volumes, so that a rod's nodes share them
evenly, but for holes; compare optimal transport in coherent point drift (Myronenko and Song 2010, "Point set
registration: coherent point drift") and its length constraint for ropes (Wang et al. 2021, "Tracking partially-occluded
deformable objects while enforcing geometric constraints"). Where that explains a cloud better, its density may grow
evenly from one end to the other, as towards a camera.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, final

import numpy as np
from jaxtyping import Bool, Float32, Float64
from threadpoolctl import ThreadpoolController

from app.core.types import Points
from app.sim.rods.geometry.orders import core_density, reconnect, shortest_orders
from app.sim.rods.geometry.polyline import distance, lengths, of_equal_steps, places, resample_polyline, turns
from app.sim.rods.geometry.rope_cloud import RopeShape, Weighted

_NOISE = 0.19
"""Standard deviation of a point's place, in radii: 1.5 mm for 8 mm."""
_MOST_POINTS = 450
"""Largest number of points; more are averaged in cells of equal area."""
_ROUNDS = 8
_SMOOTHING = (3.0, 1.0)
"""Weight of squared second differences in the first and in the last round of a hypothesis."""
_REFINING_ROUNDS = 6
"""Rounds for which scored hypotheses are refined, with `SMOOTHING`."""
SMOOTHING = 0.2
"""Weight of a squared second difference beside the squared distances of a node's share of particles: waves of 6 nodes
keep 0.81 of their height, of 8 nodes 0.93, and particles of a thick rope do not bend its middle."""
_BALANCE = (1.0, 0.3)
"""Share of the balanced place, beside that of the nearest point, in the first and in the last round."""
_SLOPE_VARIANCE, _LEAST_DENSITY = 0.5, 0.25
"""Variance of the slope of an even cloud's density, in that of points at random; least density, 1 in the mean."""
_TRIED_UNEVEN, _UNEVEN_COST = 2, 0.5
"""Number of the best lines for which a cloud may be uneven, and the cost of that. It explains clouds that are even, as
reconstructions are, by 0.06 at most better, random points of an even rope by up to 1.6, one in twenty by more than 0.5,
and points of a rope that is twice as dense at one end mostly by 2 to 12."""
_HOLE = 1.9
"""Distance along the rope without a point that is a hole in the cloud, in radii."""
_TRIED, _RECONNECTED, _VARIATIONS = 6, 8, 3
_SURE = 6.0
"""Margin over all other orders beyond which none is looked for."""
_WEIGHTS = {"residual": 9.0, "uneven": 0.37, "overlap": 0.50, "bend": 0.14, "bare": 0.31}
"""Weights of a score's terms, fitted by logistic regression to right and wrong orders of 170 clouds of folded ropes, as
those of `bench.centrelines` but of another seed, with a penalty on large weights: a score is no log probability."""
_OVERLAP = 1.85
"""Distance of strands in radii that is too little: fitted lines are shrunk a little where they bend."""
_FAR_OFF = 9.0
"""A squared deviation, in variances, beyond which a point is not explained; larger ones count as this."""
_BLAS = ThreadpoolController()
"""NumPy's thread pool: its matrices here are so small that threads take ten times as long."""
_KEPT = 4096
"""Clouds whose centrelines are remembered, more than a large study has views: 60 MB, of folded ropes up to 280."""
_PRIOR = 1.0, 4.0
"""Standard deviation of the prior centreline, in radii, and the most that it counts."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Trace:
    """Centrelines (K, n, 2) [m] that were tried, the best first, and how badly each explains the cloud.

    `cloud`: the points that they were fitted to.
    """

    lines: Float64[np.ndarray, "K n 2"]
    scores: Float64[np.ndarray, " K"]
    cloud: Weighted
    rope: RopeShape

    @property
    def line(self) -> Float64[np.ndarray, "n 2"]:
        """The best."""
        return self.lines[0]

    @property
    def rival(self) -> int | None:
        """Index of the best line that is another: nodes differ by a radius in the mean, either end first."""
        for k in range(1, len(self.lines)):
            if distance(self.lines[k], self.line) > self.rope.radius_m:
                return k
        return None

    @property
    def margin(self) -> float:
        """Cost of the rival beyond the best line's; infinite where there is none."""
        return float("inf") if self.rival is None else float(self.scores[self.rival] - self.scores[0])

    def near(self, line: Float64[np.ndarray, "n 2"]) -> Float64[np.ndarray, "n 2"]:
        """The best where the centreline was predicted to be there [m], running the same way."""
        costs = self.scores + _cost_of_distance(self.lines, line, self.rope)
        return _orient(self.lines[[costs.argmin()]], line)[0]


@final
class _Fits(NamedTuple):
    """Lines (K, n, 2), how badly each explains the cloud, and whether the cloud was taken for uneven."""

    lines: Float64[np.ndarray, "K n 2"]
    scores: Float64[np.ndarray, " K"]
    uneven: Bool[np.ndarray, " K"]

    def by_score(self) -> "_Fits":
        """The best first, without non-finite ones."""
        order = np.argsort(self.scores, kind="stable")
        order = order[np.isfinite(self.scores[order])]
        return _Fits(*(each[order] for each in self))


def trace(x: Points, rope: RopeShape, near: Float64[np.ndarray, "n 2"] | None = None) -> Trace:
    """Centrelines through particles `x` of a rope on the table z = 0.

    `near`: where the centreline was predicted to be [m]; it is one hypothesis more, and others that are far from it
    count less. The result then runs the same way; else from the end with the smaller x. It does not depend on the order
    of the particles. Thousands are kept: who simulates a rope and who judges its cloud ask for the same one, and every
    model is compared with the same views.
    """
    prior = None if near is None else np.ascontiguousarray(near, np.float64).tobytes()
    return _trace(np.ascontiguousarray(x, np.float32).tobytes(), rope, prior)


@lru_cache(maxsize=_KEPT)
@_BLAS.wrap(limits=1, user_api="blas")
def _trace(points: bytes, rope: RopeShape, prior: bytes | None) -> Trace:
    x = np.frombuffer(points, np.float32).reshape(-1, 3)
    near = None if prior is None else np.frombuffer(prior, np.float64).reshape(-1, 2)
    cloud = weigh_points(x, rope)
    orders = shortest_orders(cloud.at, cloud.weight, _spots(rope, len(cloud.at)), rope.radius_m, _TRIED)
    starts = [resample_polyline(order, rope.count) for order in orders]
    if near is not None:
        starts.append(near - cloud.origin)
    fits = _fit(np.stack(starts), cloud, rope, near).by_score()
    if len(fits.lines) > 1 or strands_touch(fits.lines[0], rope):
        fits = _with_reconnections(fits, cloud, rope, near)
    lines = _refine(fits.lines, cloud, rope, fits.uneven)
    return Trace(lines=_orient(lines + cloud.origin, near), scores=fits.scores, cloud=cloud, rope=rope)


@_BLAS.wrap(limits=1, user_api="blas")
def settle(x: Points, line: Float64[np.ndarray, "n 2"], rope: RopeShape) -> Float64[np.ndarray, "n 2"]:
    """Centreline [m] through particles `x` that run in the order of `line`, found as `trace` finds it in the end."""
    cloud = weigh_points(x, rope)
    lines = of_equal_steps(line[None] - cloud.origin, rope.rest_m)
    uneven = np.array([False, True])
    either = _refine(np.repeat(lines, 2, axis=0), cloud, rope, uneven)
    return either[(_scores(either, cloud, rope, None) + _UNEVEN_COST * uneven).argmin()] + cloud.origin


def weigh_points(x: Points, rope: RopeShape) -> Weighted:
    """Points of the plane with weights by their distance from the centreline."""
    at, variance = x[:, :2].astype(np.float64), _variance(x, rope.radius_m)
    share = np.full(len(x), 1 / len(x))
    if len(x) > _MOST_POINTS:
        at, share, variance = _average(at, variance, np.sqrt(2 * rope.radius_m * rope.length_m / _MOST_POINTS))
    origin = at.mean(0)
    return Weighted(at=at - origin, share=share, variance=variance, origin=origin)


def locate_particles(
    x: Points, line: Float64[np.ndarray, "n 2"], rope: RopeShape
) -> tuple[Float32[np.ndarray, " N"], Float32[np.ndarray, " N"]]:
    """Places of particles along a centreline that is right, in segments, and weights in a fit, one in the mean."""
    at, variance = x[:, :2].astype(np.float64), _variance(x, rope.radius_m)
    share = np.full(len(x), 1 / len(x))
    cloud = Weighted(at=at, share=share, variance=variance, origin=np.zeros(2))
    along = balance_places(places(line[None], at, rope.beyond)[0], share, rope, _BALANCE[1], np.array([True]))
    beyond = _beyond(np.zeros(1), through(along, cloud, rope.count, SMOOTHING), rope)
    along = _stretch(along, beyond, rope)[0]
    return along.astype(np.float32), cloud.weight.astype(np.float32)


def radius_of(x: Points, rest_m: float) -> float:
    """Radius [m] of an evenly filled cylinder whose heights deviate as those of `x`; near `rest_m` in any case."""
    return float(np.clip(2 * np.std(x[:, 2]), 0.3 * rest_m, 2 * rest_m))


def balance_places(
    along: Float64[np.ndarray, "K N"],
    share: Float64[np.ndarray, " N"],
    rope: RopeShape,
    balance: float,
    uneven: Bool[np.ndarray, " K"] | None = None,
) -> Float64[np.ndarray, "K N"]:
    """Places such that equal lengths hold equal volumes, holes left out, as far as `balance` says (0..1).

    Beyond that places are stretched so that the first and the last particle are at the ends. `uneven`: the lines along
    which density may grow, as towards a camera; particles are then weighted by its inverse.
    """
    last, count = rope.count - 1, along.shape[1]
    order = np.argsort(along, axis=1, kind="stable")
    at, each = np.take_along_axis(along, order, 1), share[order]
    steps = np.diff(at, axis=1)
    holes = np.where(steps > _HOLE * rope.radius_m / rope.rest_m, steps, 0.0)
    all_holes = holes.sum(1, keepdims=True)
    holes *= np.minimum(all_holes, last / 2) / np.maximum(all_holes, 1e-9)
    before = np.pad(np.cumsum(holes, axis=1), ((0, 0), (1, 0)))
    filled = last - before[:, -1:]
    if uneven is not None and uneven.any():
        middle = np.clip(2 * (at - before) / filled - 1, -1.0, 1.0)
        weight = each / np.maximum(1 + _density_slope(middle, each) * middle, _LEAST_DENSITY)
        each = np.where(uneven[:, None], weight / weight.sum(1, keepdims=True), each)
    even = (np.cumsum(each, 1) - each / 2) * filled + before
    end, width = last / (2 * count), np.maximum(at[:, -1:] - at[:, :1], 1e-9)
    stretched = end + (at - at[:, :1]) / width * (last - 2 * end)
    result = np.empty_like(along)
    np.put_along_axis(result, order, balance * even + (1 - balance) * stretched, 1)
    return result


def _density_slope(at: Float64[np.ndarray, "K N"], share: Float64[np.ndarray, "K N"]) -> Float64[np.ndarray, "K 1"]:
    """Slope of a cloud's density, 1 + slope x place, over the places `at` (-1 to 1) of its points along each line.

    Three times the mean place, the first coefficient of a series of Legendre polynomials, shrunk by the variance that
    it has in an even cloud (Wiener 1949, "Extrapolation, interpolation, and smoothing of stationary time series"). The
    second coefficient, more at both ends than in the middle, is that of round ends.
    """
    slope = 3 * (share * at).sum(1, keepdims=True)
    chance = 3 * _SLOPE_VARIANCE * np.square(share).sum(1, keepdims=True)
    return slope**3 / (slope**2 + chance)


def through(
    along: Float64[np.ndarray, "K N"], cloud: Weighted, count: int, smoothing: float
) -> Float64[np.ndarray, "K n 2"]:
    """Nodes that minimise weighted squared distances of points to their places, plus squared second differences."""
    first = np.clip(np.floor(along), 0, count - 2).astype(int)
    share = (along - first)[..., None]
    rows = np.zeros((*along.shape, count))
    np.put_along_axis(rows, first[..., None], 1 - share, -1)
    np.put_along_axis(rows, first[..., None] + 1, share, -1)
    second, weight = np.diff(np.eye(count), 2, axis=0), cloud.weight
    turned = np.swapaxes(rows * weight[None, :, None], 1, 2)
    return np.linalg.solve(turned @ rows + smoothing * weight.sum() / count * second.T @ second, turned @ cloud.at)


def strands_touch(line: Float64[np.ndarray, "n 2"], rope: RopeShape) -> bool:
    """True where strands are nearer than three radii."""
    gaps = np.linalg.norm(line[:, None] - line[None], axis=-1)
    apart = np.subtract.outer(np.arange(len(line)), np.arange(len(line))) >= round(5 * rope.radius_m / rope.rest_m)
    return bool((gaps[apart] < 3 * rope.radius_m).any())


def _variance(x: Points, radius_m: float) -> Float64[np.ndarray, " N"]:
    """Variance of distances from the centreline [m^2]; see `Weighted`."""
    height = x[:, 2].astype(np.float64)
    h2 = np.clip(radius_m**2 - (height - np.median(height)) ** 2, 0.0, None)
    return h2 / 3 + (_NOISE * radius_m) ** 2


def _with_reconnections(
    fits: _Fits, cloud: Weighted, rope: RopeShape, near: Float64[np.ndarray, "n 2"] | None
) -> _Fits:
    """Lines with reconnections of the best one, then of the best that has none yet, for some rounds."""
    done = list[Float64[np.ndarray, "n 2"]]()
    for _ in range(_VARIATIONS):
        left = [line for line in fits.lines[:2] if not any(line is other or (line == other).all() for other in done)]
        if not left:
            break
        done.append(left[0])
        starts = [resample_polyline(line, rope.count) for line in reconnect(left[0], cloud, rope, _RECONNECTED)]
        more = _fit(np.stack(starts), cloud, rope, near)
        fits = _Fits(*(np.concatenate(both) for both in zip(fits, more, strict=True))).by_score()
        if Trace(lines=fits.lines, scores=fits.scores, cloud=cloud, rope=rope).margin > _SURE:
            break
    return fits


def _fit(
    starts: Float64[np.ndarray, "K n 2"], cloud: Weighted, rope: RopeShape, near: Float64[np.ndarray, "n 2"] | None
) -> _Fits:
    """Lines from `starts`, fitted to an even cloud or, the best, to an uneven one where that explains it better.

    A line that has slid along the rope sees a density that is not there, and a line that is right one that is.
    """
    lines = _fit_lines(starts, cloud, rope, np.zeros(len(starts), bool))
    scores, uneven = _scores(lines, cloud, rope, near), np.zeros(len(starts), bool)
    best = np.argsort(scores, kind="stable")[:_TRIED_UNEVEN]
    others = _fit_lines(starts[best], cloud, rope, np.ones(len(best), bool))
    costs = _scores(others, cloud, rope, near) + _UNEVEN_COST
    better = costs < scores[best]
    at = best[better]
    lines[at], scores[at], uneven[at] = others[better], costs[better], True
    return _Fits(lines, scores, uneven)


def _fit_lines(
    lines: Float64[np.ndarray, "K n 2"], cloud: Weighted, rope: RopeShape, uneven: Bool[np.ndarray, " K"]
) -> Float64[np.ndarray, "K n 2"]:
    lines = of_equal_steps(lines, rope.rest_m)
    for smoothing, balance in zip(np.linspace(*_SMOOTHING, _ROUNDS), np.linspace(*_BALANCE, _ROUNDS), strict=True):
        along = balance_places(places(lines, cloud.at)[0], cloud.share, rope, balance, uneven)
        lines = of_equal_steps(through(along, cloud, rope.count, smoothing), rope.rest_m, 2)
    return of_equal_steps(lines, rope.rest_m)


def _refine(
    lines: Float64[np.ndarray, "K n 2"], cloud: Weighted, rope: RopeShape, uneven: Bool[np.ndarray, " K"]
) -> Float64[np.ndarray, "K n 2"]:
    """Lines without the round ends of the rope, which hypotheses reach into by cutting bends."""
    beyond = np.zeros(len(lines))
    for _ in range(_REFINING_ROUNDS):
        near = places(lines, cloud.at, rope.beyond)[0]
        along = balance_places(near, cloud.share, rope, _BALANCE[1], uneven)
        free = through(_stretch(along, beyond, rope), cloud, rope.count, SMOOTHING)
        lines, beyond = of_equal_steps(free, rope.rest_m, 2), _beyond(beyond, free, rope)
    return of_equal_steps(lines, rope.rest_m)


def _beyond(
    beyond: Float64[np.ndarray, " K"], free: Float64[np.ndarray, "K n 2"], rope: RopeShape
) -> Float64[np.ndarray, " K"]:
    """Length of a cloud beyond either end of its centreline, in segments, from lines that are not yet as long as it.

    Where a line that was fitted with so much `beyond` is still too long, more of the cloud is: else the fit would cut
    bends to let it reach farther.
    """
    return np.clip(beyond + (lengths(free) - rope.length_m) / (2 * rope.rest_m), 0.0, rope.beyond)


def _stretch(
    along: Float64[np.ndarray, "K N"], beyond: Float64[np.ndarray, " K"], rope: RopeShape
) -> Float64[np.ndarray, "K N"]:
    """Places from the first node to the last, spread to so much before the one and after the other."""
    return along + beyond[:, None] * (2 * along / (rope.count - 1) - 1)


def _scores(
    lines: Float64[np.ndarray, "K n 2"], cloud: Weighted, rope: RopeShape, near: Float64[np.ndarray, "n 2"] | None
) -> Float64[np.ndarray, " K"]:
    """Costs of the lines: how badly tubes about them explain the cloud, as far as they differ; infinite, not NaN."""
    r, along_m = rope.radius_m, rope.rest_m / rope.radius_m
    along, squared = places(lines, cloud.at)
    bins = max(8, round(rope.length_m / (2.5 * r)))
    filled = bins * np.stack([np.histogram(each, bins, (0, rope.count - 1), weights=cloud.share)[0] for each in along])
    gaps = np.linalg.norm(lines[:, :, None] - lines[:, None], axis=-1)
    apart = np.subtract.outer(np.arange(rope.count), np.arange(rope.count)) >= max(2, round(5 / along_m))
    close = np.where(apart, np.clip(_OVERLAP - gaps / r, 0.0, None), 0.0) * along_m / 1.25
    middles = np.concatenate([lines, (lines[:, 1:] + lines[:, :-1]) / 2], axis=1)
    density = core_density(middles, cloud.at, cloud.weight, r)
    density /= np.median(density, axis=1, keepdims=True) + 1e-12
    terms = {
        "residual": (cloud.share * np.minimum(squared / cloud.variance, _FAR_OFF)).sum(1),
        "uneven": np.minimum(np.square(filled - 1), 1.0).sum(1),
        "overlap": np.square(close).sum((1, 2)),
        "bend": np.square(turns(lines)).sum(1) * 1.25 / along_m,
        "bare": np.clip(0.6 - density, 0.0, None).mean(1) * 2 * rope.length_m / (1.25 * r),
    }
    total = np.sum([_WEIGHTS[name] * value for name, value in terms.items()], axis=0)
    if near is not None:
        total += _cost_of_distance(lines, near - cloud.origin, rope)
    return np.nan_to_num(total, nan=np.inf, posinf=np.inf)


def _cost_of_distance(
    lines: Float64[np.ndarray, "K n 2"], near: Float64[np.ndarray, "n 2"], rope: RopeShape
) -> Float64[np.ndarray, " K"]:
    """Costs of lines that are off where the centreline was predicted to be."""
    width, most = _PRIOR
    off = np.array([distance(line, near) for line in lines]) / (width * rope.radius_m)
    return np.minimum(off**2 / 2, most)


def _average(
    at: Float64[np.ndarray, "N 2"], variance: Float64[np.ndarray, " N"], cell_m: float
) -> tuple[Float64[np.ndarray, "M 2"], Float64[np.ndarray, " M"], Float64[np.ndarray, " M"]]:
    """Points in cells, weighted by their inverse variances: places, shares and variances, as of a single point."""
    cells = np.floor(at / cell_m).astype(np.int64)
    _, which = np.unique(cells, axis=0, return_inverse=True)
    which = which.ravel()
    count, weight = np.bincount(which), np.bincount(which, 1 / variance)
    middle = np.stack([np.bincount(which, at[:, k] / variance) for k in range(2)], axis=1) / weight[:, None]
    return middle, count / len(at), count / weight


def _spots(rope: RopeShape, points: int) -> int:
    return int(np.clip(round(1.1 * rope.length_m / (1.25 * rope.radius_m)), 4, max(4, min(64, points // 2))))


def _orient(
    lines: Float64[np.ndarray, "K n 2"], near: Float64[np.ndarray, "n 2"] | None
) -> Float64[np.ndarray, "K n 2"]:
    """Each the way of `near`, or from the end with the smaller x (and y)."""

    def turned(line: Float64[np.ndarray, "n 2"]) -> bool:
        if near is None:
            return bool(tuple(line[-1]) < tuple(line[0]))
        return bool(np.linalg.norm(line[::-1] - near) < np.linalg.norm(line - near))

    return np.stack([line[::-1] if turned(line) else line for line in lines])
