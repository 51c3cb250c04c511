"""The next push: the one whose outcome would best tell the remaining models apart.

T-optimal between survivors (Atkinson and Fedorov 1975, "The design of experiments for discriminating between two rival
models"): sum over pairs of pi pi' times the squared distance between what they predict.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from jaxtyping import Float32, Float64

from app.core.geometry.track import Track
from app.core.types import Points
from app.discovery.dataset.model_under_test import Subject, Theta
from app.discovery.dataset.names import effect_name
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.simulation_batch import SimulationBatch, prepare
from app.discovery.results.case import NextPush
from app.policy.random_pushes import PushDesign, Stroke, random_stroke
from app.policy.random_sweeps import random_sweep, sweep_design
from app.sim.effects.base import MIDDLE_M

_CANDIDATES = {"cpu": 24, "gpu": 200}
_PAUSE_S = 1.0
_EDGE_M = 0.13
"""Nearer to the edge of the table than this the tool does not go, as in `strokes.REGION`."""
_MM, _CM = 1e3, 1e2


def next_push(
    predictor: Predictor,
    trials: SimulationBatch,
    models: Mapping[str, tuple[float, Theta]],
    *,
    platform: str,
    height_m: float,
    seed: int = 0,
) -> NextPush | None:
    """Push that discriminates two or more models, each with its probability; None if there are fewer.

    None, too, of what is carried or poured, whose motions are not designed, and where none of the pushes that were
    tried can be simulated by all of them. `height_m`: of the tool's tip above the table while it pushes.
    """
    if len(models) < 2:  # A single model has no rival.
        return None
    if predictor.subject.kind.is_in_space or predictor.subject.kind.is_poured:
        return None
    last = trials.study.pushes[-1].after
    asked = _possible_pushes(predictor, trials.study, last, _CANDIDATES[platform], height_m, seed)
    ends = predictor(prepare(asked, predictor.subject), [theta for _, theta in models.values()]).after
    apart = _apart(ends, [probability for probability, _ in models.values()])
    if not np.isfinite(apart).any():  # No push that every model survives.
        return None
    best = int(np.nanargmax(apart))
    first, second = _rivals(ends[:, best], [probability for probability, _ in models.values()])
    distance = _distance_m(ends[first, best], ends[second, best])
    track = asked.pushes[best].command
    names = list(models)
    return NextPush(
        track=track,
        between=tuple(names),
        apart_mm=_MM * distance,
        before=last.points,
        ends=tuple(end for end in ends[:, best]),
        text=f"{push_words(track, height_m, predictor.catalogue.origin_m)}: {effect_name(names[first])} and "
        f"{effect_name(names[second])} leave the object {_MM * distance:.1f} mm apart.",
    )


def _possible_pushes(
    predictor: Predictor, study: Study, last: ProjectionView, count: int, height_m: float, seed: int
) -> Study:
    """Pushes that might be made from where the object is now."""
    rng, start_s = np.random.default_rng(seed), last.time_s + _PAUSE_S
    before, pushes = replace(last, time_s=start_s), list[Push]()
    x, y = (reach - _EDGE_M for reach in predictor.catalogue.reach_m)
    region = (MIDDLE_M[0] - x, MIDDLE_M[1] - y, MIDDLE_M[0] + x, MIDDLE_M[1] + y)
    for _ in range(count):
        stroke = _random_stroke(rng, last.points, predictor.subject, region)
        track = stroke.track(start_s=start_s, height_m=height_m)
        after = replace(last, time_s=track.end_s)
        pushes.append(Push(episode=0, before=before, during=(), after=after, command=track, measured=None))
    return replace(study, pushes=tuple(pushes), tables={})


def _random_stroke(
    rng: np.random.Generator, x: Points, subject: Subject, region: tuple[float, float, float, float]
) -> Stroke:
    """A push of the finger or a sweep of the paddle."""
    if subject.paddle_half_m is not None:
        return random_sweep(
            rng, x, sweep_design(1, 1), radius_m=subject.radius_m, half_m=subject.paddle_half_m, region=region
        )
    core_m = (0.0, 0.0) if subject.finger is None else subject.finger.half_m
    return random_stroke(rng, x, PushDesign(), core_m, region)


def _apart(ends: Float32[np.ndarray, "M C N 3"], probabilities: Sequence[float]) -> Float64[np.ndarray, " C"]:
    """Mean squared distance of the models' predictions for each candidate, over pairs [m^2]."""
    total = np.zeros(ends.shape[1])
    for i, j in combinations(range(len(ends)), 2):
        squared = ((ends[i] - ends[j])[..., :2].astype(np.float64) ** 2).sum(-1).mean(-1)
        total += probabilities[i] * probabilities[j] * squared
    return total


def _rivals(ends: Float32[np.ndarray, "M N 3"], probabilities: Sequence[float]) -> tuple[int, int]:
    """The two that count most for the choice: probable, and far apart."""

    def weight(pair: tuple[int, int]) -> float:
        return float(_apart(ends[list(pair), None], [probabilities[k] for k in pair])[0])

    return max(combinations(range(len(probabilities)), 2), key=weight)


def _distance_m(a: Points, b: Points) -> float:
    return float(np.sqrt(((a - b)[:, :2].astype(np.float64) ** 2).sum(1).mean()))


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
