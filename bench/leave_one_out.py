"""Models fitted to all pushes but one, on a lattice of their parameters; each fold looks at its own pushes alone.

What a model predicts is kept, so that folds that try the same model pay for it once. That tells a fold nothing of the
push that it leaves out: where it goes next depends on the errors of its own pushes, and on nothing else.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Bool, Float64
from scipy.stats import binomtest, t

Place: TypeAlias = tuple[tuple[str, int], ...]
"""Lattice point: the axes along which a model differs from its start, by name, and the number of steps."""
Errors: TypeAlias = Callable[[Sequence[Place]], Float64[np.ndarray, "Q K"]]
"""Errors of models on each push; NaN if nothing is predicted."""


def placed(steps: Mapping[str, int]) -> Place:
    """The place so many steps away."""
    return tuple(sorted((name, count) for name, count in steps.items() if count))


def beside(place: Place, axes: Collection[str]) -> list[Place]:
    """The places a step away along one axis."""
    here = dict(place)
    return [placed(here | {name: here.get(name, 0) + step}) for name in axes for step in (-1, 1)]


def folds(count: int) -> Bool[np.ndarray, "F K"]:
    """Mask of the pushes that each fold is fitted to: all but one, and in the last fold all."""
    return np.concatenate([~np.eye(count, dtype=bool), np.ones((1, count), bool)])


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Fitted:
    """A place for each fold."""

    places: tuple[Place, ...]
    train: Bool[np.ndarray, "F K"]

    def left_out(self, values: Callable[[Place], np.ndarray]) -> np.ndarray:
        """Values of each push, the first axis of `values`, by the model that was fitted to the others."""
        return np.stack([values(place)[k] for k, place in enumerate(self.places[:-1])])


def loss(errors: Float64[np.ndarray, " K"], train: Bool[np.ndarray, " K"]) -> float:
    """The mean over a fold's pushes; infinite where one of them is not predicted."""
    mean = float(errors[train].mean())
    return mean if np.isfinite(mean) else float("inf")


def descend(errors: Errors, start: Fitted, axes: Collection[str], rounds: int) -> Fitted:
    """Each fold steps to the best place beside it while that is better on its pushes (Hooke and Jeeves 1961)."""
    here = list(start.places)
    moving = set(range(len(here)))
    for _ in range(rounds):
        tried = {fold: [here[fold], *beside(here[fold], axes)] for fold in sorted(moving)}
        if not tried:
            break
        best = chosen(errors, tried, start.train)
        moving = {fold for fold, place in best.items() if place != here[fold]}
        for fold in moving:
            here[fold] = best[fold]
    return Fitted(places=tuple(here), train=start.train)


def chosen(errors: Errors, tried: Mapping[int, Sequence[Place]], train: Bool[np.ndarray, "F K"]) -> dict[int, Place]:
    """The best of the places that each fold tried; the first of several."""
    every = list(dict.fromkeys(place for places in tried.values() for place in places))
    found = dict(zip(every, errors(every), strict=True))
    return {fold: min(places, key=lambda place: loss(found[place], train[fold])) for fold, places in tried.items()}


@final
@dataclass(frozen=True, kw_only=True)
class Paired:
    """Paired comparison of errors on the same pushes: mean gain, 90 % interval, pushes that gain, p.

    The interval is Student's, which a few pushes make wide; `p` is of the exact sign test, two-sided.
    """

    mean: float
    low: float
    high: float
    better: int
    p: float


def paired(errors: Float64[np.ndarray, " K"], others: Float64[np.ndarray, " K"]) -> Paired:
    """Compare `errors` with `others`."""
    gain = others - errors
    reach = float(t.ppf(0.95, len(gain) - 1) * gain.std(ddof=1) / np.sqrt(len(gain)))
    better, unequal = int((gain > 0).sum()), int((gain != 0).sum())
    p = float(binomtest(better, unequal).pvalue) if unequal else 1.0
    mean = float(gain.mean())
    return Paired(mean=mean, low=mean - reach, high=mean + reach, better=better, p=p)
