"""Motions that might be made next from where the object is, at random by kind of tool, and words for them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, TypeAlias, final

import numpy as np
from jaxtyping import Float64

from app.core.geometry.track import Track
from app.core.types import OPENING
from app.discovery.dataset.bowls import PouredBowls
from app.discovery.dataset.model_under_test import Catalogue, Subject
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.policy.random_carries import carry_design, random_carry
from app.policy.random_pours import SOUP_FURTHER_RAD, WATER_FURTHER_RAD, random_pour
from app.policy.random_pushes import PushDesign, random_stroke
from app.policy.random_sweeps import random_sweep, sweep_design
from app.sim.effects.base import MIDDLE_M, SOUPS

Draw: TypeAlias = Callable[[np.random.Generator], Track]

_PAUSE_S: Final = 1.0
_EDGE_M: Final = 0.13
"""Nearer to the edge of the table than this the tool does not go, as in `strokes.REGION`."""
_LEFT: Final = 0.4
"""Least share of a liquid in the held bowl that is poured on from; with less the next pour begins with all of it."""
_CM: Final = 1e2
_STILL_M, _STOP_M, _TILTED_RAD = 1e-4, 1e-2, 1e-3
"""A tool that moves less than the first between two moments rests; rests that are nearer than the second are one."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class CandidateMotions:
    """Motions to choose from as a study of pushes that begin alike.

    `anew`: the object has to be laid, or filled in, again as it is at their beginning.
    """

    study: Study
    anew: bool

    @property
    def before(self) -> ProjectionView:
        """The object at the beginning of each."""
        return self.study.pushes[0].before

    @property
    def tracks(self) -> list[Track]:
        """Tracks of all of them."""
        return [push.command for push in self.study.pushes]


def candidate_motions(
    subject: Subject, catalogue: Catalogue, study: Study, *, count: int, height_m: float, seed: int
) -> CandidateMotions:
    """So many motions that go on from the last view of the study. `height_m`: of a pushing tool's tip while it pushes.

    Where most of a liquid is poured already they begin as the last episode did.
    """
    last = study.pushes[-1]
    first = next(push for push in study.pushes if push.episode == last.episode)
    anew = subject.bowls is not None and 1 - subject.bowls.share(last.after.points) < _LEFT
    seen, start = (first.before, first.command.poses[0]) if anew else (last.after, last.command.poses[-1])
    start_s = last.after.time_s + _PAUSE_S
    before = replace(seen, time_s=start_s, finger=None)
    draw = _draw_of(subject, catalogue, before, start, start_s, height_m)
    rng = np.random.default_rng(seed)
    pushes = [_push(before, draw(rng)) for _ in range(count)]
    return CandidateMotions(study=replace(study, pushes=tuple(pushes), tables={}), anew=anew)


def _push(before: ProjectionView, track: Track) -> Push:
    after = replace(before, time_s=track.end_s)
    return Push(episode=0, before=before, during=(), after=after, command=track, measured=None)


def _draw_of(
    subject: Subject,
    catalogue: Catalogue,
    seen: ProjectionView,
    start: Float64[np.ndarray, " T"],
    start_s: float,
    height_m: float,
) -> Draw:
    """Random motion of the subject's tool; one that holds the object goes on from its pose `start`."""
    if subject.bowls is not None:
        further_rad = SOUP_FURTHER_RAD if subject.kind.name in SOUPS else WATER_FURTHER_RAD
        return _pours(subject.bowls, seen, start[:3], start_s, further_rad)
    if subject.kind.is_in_space:
        closed_m = float(start[OPENING])
        return lambda rng: random_carry(rng, start, carry_design(1, 1), start_s=start_s, closed_m=closed_m)
    x, y = (reach - _EDGE_M for reach in catalogue.reach_m)
    region = (MIDDLE_M[0] - x, MIDDLE_M[1] - y, MIDDLE_M[0] + x, MIDDLE_M[1] + y)
    if (half_m := subject.paddle_half_m) is not None:
        return lambda rng: random_sweep(
            rng, seen.points, sweep_design(1, 1), radius_m=subject.radius_m, half_m=half_m, region=region
        ).track(start_s=start_s, height_m=height_m)
    core_m = (0.0, 0.0) if subject.finger is None else subject.finger.half_m
    return lambda rng: random_stroke(rng, seen.points, PushDesign(), core_m, region).track(
        start_s=start_s, height_m=height_m
    )


def _pours(
    bowls: PouredBowls,
    seen: ProjectionView,
    start_m: Float64[np.ndarray, "3"],
    start_s: float,
    further_rad: tuple[float, float],
) -> Draw:
    left_m3 = (1 - bowls.share(seen.points)) * bowls.volume_m3
    around = bowls.place_m[:2]
    return lambda rng: random_pour(
        rng, start_m, around, volume_m3=left_m3, radius_m=bowls.held_radius_m, further_rad=further_rad
    ).track(start_s=start_s)


def motion_words(
    track: Track, subject: Subject, *, height_m: float, origin_m: tuple[float, float], anew: bool = False
) -> str:
    """A motion in words. `origin_m`: see `Catalogue`; `height_m`, `anew`: see `candidate_motions`."""
    if subject.bowls is not None:
        return ("Fill the held bowl again. " if anew else "") + _pour_words(track, subject.bowls, origin_m)
    return _carry_words(track, origin_m) if subject.kind.is_in_space else push_words(track, height_m, origin_m)


def push_words(track: Track, height_m: float, origin_m: tuple[float, float] = (0.0, 0.0)) -> str:
    """A push in words, for example `Push 10 cm at 0.05 m/s from (0.50, 0.02) m, 30 degrees from x`.

    `origin_m`: see `Catalogue`.
    """
    way, times_s = track.positions + np.array([*origin_m, 0.0]), track.times_s
    low = np.flatnonzero(way[:, 2] < height_m + 1e-3)
    start, end = way[low[0], :2], way[low[-1], :2]
    moving = np.flatnonzero(np.linalg.norm(np.diff(way[low, :2], axis=0), axis=1) > 1e-5)
    duration = float(times_s[low][moving[-1] + 1] - times_s[low][moving[0]]) if len(moving) else 1.0
    length = float(np.linalg.norm(np.diff(way[low, :2], axis=0), axis=1).sum())
    heading = np.degrees(np.arctan2(*(end - start)[::-1]))
    return (
        f"Push {_CM * length:.0f} cm at {length / duration:.2f} m/s from ({start[0]:.2f}, {start[1]:.2f}) m, "
        f"{heading:.0f} degrees from x"
    )


def _carry_words(track: Track, origin_m: tuple[float, float]) -> str:
    """A carry in words: the places where the gripper comes to rest, and its time."""
    way = track.positions + np.array([*origin_m, 0.0])
    rests = np.flatnonzero(np.linalg.norm(np.diff(way, axis=0), axis=1) < _STILL_M)
    stops = [way[0]]
    for place in (*way[rests + 1], way[-1]):
        if np.linalg.norm(place - stops[-1]) > _STOP_M:
            stops.append(place)
    places = " to ".join(f"({x:.2f}, {y:.2f}, {z:.2f}) m" for x, y, z in stops)
    return f"Carry it from {places} in {track.end_s - track.times_s[0]:.1f} s"


def _pour_words(track: Track, bowls: PouredBowls, origin_m: tuple[float, float]) -> str:
    """A pour in words: how far the bowl is tilted, how long it takes and stays there, and where it goes on to."""
    lean = np.arccos(np.clip(1 - 2 * (track.poses[:, 4] ** 2 + track.poses[:, 5] ** 2), -1.0, 1.0))
    lean = np.pi - lean  # The tool points down where the bowl is upright.
    steepest = np.flatnonzero(lean > lean.max() - _TILTED_RAD)
    times = track.times_s - track.times_s[0]
    over_s, hold_s = float(times[steepest[0]]), float(times[steepest[-1]] - times[steepest[0]])
    x, y = track.positions[-1, :2] + origin_m
    aim_m = np.linalg.norm(track.positions[steepest[0], :2] - bowls.place_m[:2])
    return (
        f"Tilt the bowl by {np.degrees(lean.max()):.0f} degrees, its middle {_CM * aim_m:.0f} cm beside the other's, "
        f"within {over_s:.1f} s, hold it there for {hold_s:.1f} s, and go on to ({x:.2f}, {y:.2f}) m"
    )
