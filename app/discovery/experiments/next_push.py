"""The next push: the one whose outcome would best tell the remaining models apart.

T-optimal between survivors (Atkinson and Fedorov 1975, "The design of experiments for discriminating between two rival
models"): sum over pairs of pi pi' times the squared distance between what they predict.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import combinations
from typing import Final, TypeAlias

import numpy as np
from jaxtyping import Float32, Float64

from app.core.types import Points
from app.discovery.dataset.model_under_test import Subject, Theta
from app.discovery.dataset.names import effect_name
from app.discovery.experiments.candidate_motions import candidate_motions, motion_words
from app.discovery.residuals.poured_contents import contents_m
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.simulation_batch import SimulationBatch, prepare
from app.discovery.results.case import NextPush

Measure: TypeAlias = Callable[[Points, Points], float]
"""Squared distance of two predictions [m^2]."""

CANDIDATES: Final = {"cpu": 24, "gpu": 200}
"""Motions that are simulated, by platform."""
_MM = 1e3


def next_push(
    predictor: Predictor,
    trials: SimulationBatch,
    models: Mapping[str, tuple[float, Theta]],
    *,
    count: int,
    height_m: float,
    seed: int = 0,
) -> NextPush | None:
    """Push that discriminates two or more models, each with its probability; None if there are fewer.

    A sweep, a carry or a pour where the object is swept, carried or poured. None, too, where none of the `count`
    that are tried can be simulated by all models. `height_m`: of a pushing tool's tip above the table while it pushes.
    """
    if len(models) < 2:  # A single model has no rival.
        return None
    subject, catalogue = predictor.subject, predictor.catalogue
    asked = candidate_motions(subject, catalogue, trials.study, count=count, height_m=height_m, seed=seed)
    ends = predictor(prepare(asked.study, subject), [theta for _, theta in models.values()]).after
    measure = partial(_squared_distance_m2, subject)
    apart = _apart(ends, [probability for probability, _ in models.values()], measure)
    if not np.isfinite(apart).any():  # No push that every model survives.
        return None
    best = int(np.nanargmax(apart))
    first, second = _rivals(ends[:, best], [probability for probability, _ in models.values()], measure)
    distance = _MM * float(np.sqrt(measure(ends[first, best], ends[second, best])))
    track, names = asked.tracks[best], list(models)
    words = motion_words(track, subject, height_m=height_m, origin_m=catalogue.origin_m, anew=asked.anew)
    amount = f"{distance:.1f} {subject.kind.unit}"
    said = f"differ by {amount}" if subject.kind.is_poured else f"leave the object {amount} apart"
    return NextPush(
        track=track,
        between=tuple(names),
        apart_mm=distance,
        before=asked.before.points,
        ends=tuple(ends[:, best]),
        text=f"{words}: {effect_name(names[first])} and {effect_name(names[second])} {said}.",
    )


def _apart(
    ends: Float32[np.ndarray, "M C N 3"], probabilities: Sequence[float], measure: Measure
) -> Float64[np.ndarray, " C"]:
    """Mean squared distance of the models' predictions for each candidate, over pairs [m^2]."""
    total = np.zeros(ends.shape[1])
    for i, j in combinations(range(len(ends)), 2):
        squared = [measure(a, b) for a, b in zip(ends[i], ends[j], strict=True)]
        total += probabilities[i] * probabilities[j] * np.array(squared)
    return total


def _rivals(ends: Float32[np.ndarray, "M N 3"], probabilities: Sequence[float], measure: Measure) -> tuple[int, int]:
    """The two that count most for the choice: probable, and far apart."""

    def weight(pair: tuple[int, int]) -> float:
        return float(_apart(ends[list(pair), None], [probabilities[k] for k in pair], measure)[0])

    return max(combinations(range(len(probabilities)), 2), key=weight)


def _squared_distance_m2(subject: Subject, a: Points, b: Points) -> float:
    """Mean squared distance of particles, over the table or in space; of a liquid that of its residual [m^2]."""
    if subject.bowls is not None:
        return float((contents_m(subject.bowls, a) - contents_m(subject.bowls, b))[0]) ** 2
    compared = slice(3 if subject.kind.is_in_space else 2)
    return float(((a - b)[:, compared].astype(np.float64) ** 2).sum(-1).mean())
