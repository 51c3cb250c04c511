"""Orders of a rope's points along it: short paths through spots of its cloud, and reconnections of a line.

A path that visits all spots of a rope once and is short keeps to the strands, as steps along a strand are shorter than
those from strand to strand. Local search: Lin 1965 ("2-opt"), Or 1976 ("Or-opt").
"""

from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float64, Int64

from app.sim.rods.geometry.rope_cloud import RopeShape, Weighted

_WIDTH = 0.44
"""Standard deviation of the kernel of densities, in radii."""
_SEAM = 2.0
"""Cost factor added to a step that leaves the dense core of the rope."""
_FAR = 3.75
"""Steps longer than so many radii are over no rope."""
_POWER = 1.5
"""Exponent of a step's length in its cost: above one, many short steps are better than few long ones."""
_STARTS, _MOVES, _ROUNDS = 12, 400, 8
_APART = 4
"""Nodes of a line nearer than this along it are not joined anew."""


def shortest_orders(
    at: Float64[np.ndarray, "N 2"], weight: Float64[np.ndarray, " N"], spots: int, radius_m: float, most: int
) -> list[Float64[np.ndarray, "spots 2"]]:
    """Spots of a cloud [m] in the orders of short paths through all of them, the shortest first; up to `most`."""
    centres = spread_evenly(at, weight, spots)
    cost = np.zeros((spots + 1, spots + 1))  # The last is no spot: it closes the path to a tour at no cost.
    cost[:spots, :spots] = step_costs(centres, at, weight, radius_m)
    tours = [_improve(cost, tour) for tour in _greedy(cost)]
    lengths = [cost[tour, np.roll(tour, -1)].sum() for tour in tours]
    found = dict[tuple[int, ...], Int64[np.ndarray, " spots"]]()
    for k in np.argsort(lengths, kind="stable"):
        path = np.roll(tours[k], -int(np.flatnonzero(tours[k] == spots)[0]) - 1)[:spots]
        found.setdefault(tuple((path if path[0] < path[-1] else path[::-1]).tolist()), path)
    return [centres[path] for path in list(found.values())[:most]]


def reconnect(
    line: Float64[np.ndarray, "n 2"], cloud: Weighted, rope: RopeShape, most: int
) -> list[Float64[np.ndarray, "n 2"]]:
    """Nodes in other orders: a part of the line is run through the other way; those with the least cost."""
    n = len(line)
    cost = step_costs(line, cloud.at, cloud.weight, rope.radius_m)
    along = cost[np.arange(n - 1), np.arange(1, n)]
    first, last = np.triu_indices(n, _APART)  # The part first..last is turned.
    before = np.where(first > 0, cost[first - 1, last] - along[first - 1], 0.0)
    after = np.where(last < n - 1, cost[first, (last + 1) % n] - along[np.minimum(last, n - 2)], 0.0)
    chosen = list[tuple[int, int]]()
    for k in np.argsort(before + after, kind="stable"):
        part = int(first[k]), int(last[k])
        if part == (0, n - 1) or any(abs(part[0] - a) + abs(part[1] - b) < _APART for a, b in chosen):
            continue
        chosen.append(part)
        if len(chosen) == most:
            break
    return [np.concatenate([line[:a], line[a : b + 1][::-1], line[b + 1 :]]) for a, b in chosen]


def spread_evenly(
    at: Float64[np.ndarray, "N 2"], weight: Float64[np.ndarray, " N"], count: int
) -> Float64[np.ndarray, "count 2"]:
    """Centres of `count` clusters: the farthest points first, then Lloyd's iteration with weights."""
    centres, nearest = [at[int(np.argmax(weight))]], np.full(len(at), np.inf)
    for _ in range(count - 1):
        nearest = np.minimum(nearest, np.square(at - centres[-1]).sum(1))
        centres.append(at[int(np.argmax(nearest))])
    found = np.array(centres)
    for _ in range(_ROUNDS):
        which = (np.square(found).sum(1) - 2 * at @ found.T).argmin(1)
        total = np.bincount(which, weight, count)
        sums = np.stack([np.bincount(which, weight * at[:, k], count) for k in range(2)], axis=1)
        found = np.where(total[:, None] > 0, sums / np.maximum(total, 1e-12)[:, None], found)
    return found


def core_density(
    of: Float64[np.ndarray, "*K 2"],
    at: Float64[np.ndarray, "N 2"],
    weight: Float64[np.ndarray, " N"],
    radius_m: float,
) -> Float64[np.ndarray, "*K"]:
    """Density of points, weighted so that those of the core of a rope count most, without a unit."""
    flat = of.reshape(-1, 2)
    squared = np.square(flat).sum(1)[:, None] + np.square(at).sum(1) - 2 * flat @ at.T
    kernel = np.exp(np.minimum(squared, 25 * radius_m**2) * (-0.5 / (_WIDTH * radius_m) ** 2))
    return (kernel @ weight).reshape(of.shape[:-1])


def step_costs(
    spots: Float64[np.ndarray, "K 2"],
    at: Float64[np.ndarray, "N 2"],
    weight: Float64[np.ndarray, " N"],
    radius_m: float,
) -> Float64[np.ndarray, "K K"]:
    """Costs of steps between spots: their length, and more where they leave the core."""
    gap = np.linalg.norm(spots[:, None] - spots[None], axis=-1)
    upper: Bool[np.ndarray, "K K"] = np.triu(gap < _FAR * radius_m, 1)
    one, other = np.nonzero(upper)
    between = spots[one][:, None] + (spots[other] - spots[one])[:, None] * np.array([0.3, 0.5, 0.7])[:, None]
    usual = np.median(core_density(spots, at, weight, radius_m))
    dense = np.minimum(core_density(between, at, weight, radius_m).mean(1) / usual, 1.0)
    dearer = np.full(gap.shape, 1 + _SEAM)
    dearer[one, other] = dearer[other, one] = 1 + _SEAM * (1 - dense)
    return dearer * (gap / (1.25 * radius_m)) ** _POWER


def _greedy(cost: Float64[np.ndarray, "m m"]) -> list[Int64[np.ndarray, " m"]]:
    """Tours to the nearest spot that is left, with some chance, from several starts."""
    rng, last = np.random.default_rng(0), len(cost) - 1
    tours = list[Int64[np.ndarray, " m"]]()
    for start in rng.permutation(last)[:_STARTS].tolist():
        noisy = cost[:last, :last] * np.exp(0.3 * rng.standard_normal((last, last)))
        left, tour = np.zeros(last), [start]
        for _ in range(last - 1):
            left[tour[-1]] = np.inf
            tour.append(int((noisy[tour[-1]] + left).argmin()))
        tours.append(np.array([*tour, last]))
    return tours


def _improve(cost: Float64[np.ndarray, "m m"], tour: Int64[np.ndarray, " m"]) -> Int64[np.ndarray, " m"]:
    """The tour after exchanges of two steps, and moves of up to three spots, until none makes it shorter."""
    for _ in range(_MOVES):
        better = _exchange(cost, tour)
        better = _move_segments(cost, tour) if better is None else better
        if better is None:
            break
        tour = better
    return tour


def _exchange(cost: Float64[np.ndarray, "m m"], tour: Int64[np.ndarray, " m"]) -> Int64[np.ndarray, " m"] | None:
    """Steps (i, i + 1) and (j, j + 1) become (i, j) and (i + 1, j + 1), where that saves most."""
    here = cost[np.ix_(tour, tour)]
    step = np.append(np.diagonal(here, 1), here[-1, 0])
    change = here + np.roll(here, (-1, -1), (0, 1)) - step[:, None] - step
    change[_lower(len(tour))] = 0.0
    i, j = divmod(int(change.argmin()), len(tour))
    if change[i, j] > -1e-9:
        return None
    return np.concatenate([tour[: i + 1], tour[i + 1 : j + 1][::-1], tour[j + 1 :]])


@lru_cache(maxsize=8)
def _lower(m: int) -> Bool[np.ndarray, "m m"]:
    """Mask of the pairs with j at most i + 1."""
    return np.tri(m, m, 1, dtype=bool)


def _move_segments(cost: Float64[np.ndarray, "m m"], tour: Int64[np.ndarray, " m"]) -> Int64[np.ndarray, " m"] | None:
    """A run of up to three spots is put between two others, either way round, where that saves most."""
    m, best, result = len(tour), -1e-9, None
    here = cost[np.ix_(tour, tour)]
    after = np.roll(here, -1, axis=1)
    step = np.append(np.diagonal(here, 1), here[-1, 0])
    at = np.arange(m)
    beyond = (at[None] - at[:, None]) % m
    for length in (1, 2, 3):
        first, last, left, right = at, (at + length - 1) % m, (at - 1) % m, (at + length) % m
        saved = here[left, right] - here[left, first] - here[last, right]
        barred = (beyond < length) | (beyond == m - 1)
        for turned, (head, tail) in enumerate(((first, last), (last, first))):
            change = np.where(barred, np.inf, saved[:, None] + here[head] + after[tail] - step)
            k = int(change.argmin())
            if change.flat[k] < best:
                best = float(change.flat[k])
                result = length, bool(turned), k // m, k % m
    if result is None:
        return None
    length, back, start, to = result
    rolled = np.roll(tour, -start)
    run, rest, cut = rolled[:length], rolled[length:], (to - start) % m - length + 1
    return np.concatenate([rest[:cut], run[::-1] if back else run, rest[cut:]])
