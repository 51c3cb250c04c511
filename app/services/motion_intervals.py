"""Motions of a tool between its rests, and the views before and after each. Pure."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, final

import numpy as np
from jaxtyping import Bool, Float64

from app.core.geometry.track import poses_at
from app.recording.exchange.npz_import import Poseline

_STEP_S: Final = 0.05
_OVER_S: Final = 0.2
"""Time over which speed is measured: longer than the noise of a pose, shorter than a rest."""
_RESTING_M_S: Final = 0.005
"""Speed below which a tool rests: a millimetre in the time over which it is measured."""
_REST_S: Final = 0.3
"""Shortest rest between two motions."""
_LEAST_M: Final = 0.01
"""Shortest way of a motion: a drift is shorter."""
_SETTLED_S: Final = 0.2
"""Time after a motion at which the object has come to rest, if there is a view so late."""
_MOST_STEPS: Final = 400_000


@final
@dataclass(frozen=True, kw_only=True)
class Interval:
    """A motion [s], and the views next to it; None where there is none."""

    first_s: float
    last_s: float
    before_s: float | None = None
    after_s: float | None = None


def find_motions(
    line: Poseline, moments_s: Float64[np.ndarray, " V"], given: Sequence[tuple[float, float]] = ()
) -> list[Interval]:
    """The motions of a tool, or those given by their seconds, with the views at `moments_s` next to them.

    Motions between which there is no view are one.
    """
    if given:
        return _with_views([Interval(first_s=first, last_s=last) for first, last in given], moments_s)
    return _with_views(list(_join(list(_motions(line)), moments_s)), moments_s)


def _motions(line: Poseline) -> Iterator[Interval]:
    """Intervals of motion between rests."""
    if len(line.times_s) < 2:
        return
    first, last = float(line.times_s[0]), float(line.times_s[-1])
    grid = np.linspace(first, last, min(max(int((last - first) / _STEP_S), 1) + 1, _MOST_STEPS))
    places = poses_at(grid, line.times_s, line.poses)[:, :3]
    ahead, behind = (poses_at(grid + sign * _OVER_S / 2, line.times_s, line.poses)[:, :3] for sign in (1, -1))
    moving = np.linalg.norm(ahead - behind, axis=1) > _RESTING_M_S * _OVER_S
    rest = max(round(_REST_S / max(float(grid[1] - grid[0]), 1e-9)), 1)
    for start, end in _runs(_without_short_gaps(moving, rest)):
        if float(np.linalg.norm(np.ptp(places[start:end], axis=0))) >= _LEAST_M:
            yield Interval(first_s=float(grid[start]), last_s=float(grid[end - 1]))


def _runs(mask: Bool[np.ndarray, " T"]) -> list[tuple[int, int]]:
    """Beginning and end of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return [(int(start), int(end)) for start, end in edges.reshape(-1, 2)]


def _without_short_gaps(mask: Bool[np.ndarray, " T"], shortest: int) -> Bool[np.ndarray, " T"]:
    filled = mask.copy()
    for (_, end), (start, _) in pairwise(_runs(mask)):
        if start - end < shortest:
            filled[end:start] = True
    return filled


def _join(motions: Sequence[Interval], moments_s: Float64[np.ndarray, " V"]) -> Iterator[Interval]:
    """The motions, those as one between which nothing was seen."""
    open_: Interval | None = None
    for motion in motions:
        if open_ is not None and not ((moments_s >= open_.last_s) & (moments_s <= motion.first_s)).any():
            open_ = replace(open_, last_s=motion.last_s)
            continue
        if open_ is not None:
            yield open_
        open_ = motion
    if open_ is not None:
        yield open_


def _with_views(motions: Sequence[Interval], moments_s: Float64[np.ndarray, " V"]) -> list[Interval]:
    found = list[Interval]()
    for index, motion in enumerate(motions):
        earlier = moments_s[moments_s <= motion.first_s]
        until_s = motions[index + 1].first_s if index + 1 < len(motions) else np.inf
        later = moments_s[(moments_s >= motion.last_s) & (moments_s <= until_s)]
        settled = later[later >= motion.last_s + _SETTLED_S]
        after = settled[:1] if len(settled) else later[-1:]
        found.append(
            replace(
                motion,
                before_s=float(earlier[-1]) if len(earlier) else None,
                after_s=float(after[0]) if len(after) else None,
            )
        )
    return found
