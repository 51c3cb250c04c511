"""The first verdict, from one batch of simulations: a refitted nominal model, and every cause weighed against it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64

from app.discovery.evidence import Residuals, fitted
from app.discovery.inference import CALIBRATED, HABITS, NUMERIC, Finding, Weighed, dispersion, finding, weighed
from app.discovery.predict import Predictor, Trials
from app.discovery.sensitivity import Step, moved, residuals, steps_of
from app.discovery.subject import NUMERICS, Theta

_REFITS = 2
_FAR = 2.0
"""Steps of a calibrated parameter that a refit takes at most."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Suspect:
    """A cause with what the screening says of it; `steps` are its columns, `finding.mean` their values in steps."""

    cause: str
    steps: tuple[Step, ...]
    finding: Finding


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Screening:
    """All causes, the most probable first, about the refitted nominal model."""

    about: Theta
    steps: tuple[Step, ...]
    data: Residuals
    nothing: Weighed
    suspects: tuple[Suspect, ...]


def screen(predictor: Predictor, trials: Trials, *, only: Sequence[str] | None = None) -> Screening:
    """Refit the calibrated parameters, then ask about every cause, or of `only` those."""
    catalogue, calibrated = predictor.catalogue, predictor.subject.calibrated
    own = [step for step in steps_of(catalogue, calibrated, np.zeros((0, 2))) if step.cause in calibrated]
    about = catalogue.nominal(predictor.subject)
    for _ in range(_REFITS):
        found = fitted(residuals(predictor, trials, about, own, replicas=2), np.full(len(own), CALIBRATED**2))
        for step, share in zip(own, np.clip(found.theta, -_FAR, _FAR), strict=True):
            about = moved(catalogue, about, step, float(share))
    wanted = None if only is None else {*only, *calibrated, *NUMERICS}
    steps = [
        step for step in steps_of(catalogue, calibrated, _places(trials)) if wanted is None or step.cause in wanted
    ]
    variance = prior(steps, calibrated)
    nuisance = [column for column, step in enumerate(steps) if step.cause in calibrated or step.cause in NUMERICS]
    data = residuals(predictor, trials, about, steps)
    nothing = weighed(data, variance, dispersion(fitted(data, variance), nuisance))
    groups: dict[tuple[str, tuple[tuple[int, float], ...]], list[int]] = {}
    for column, step in enumerate(steps):
        if column not in nuisance:
            groups.setdefault((step.cause, step.given), []).append(column)
    suspects = [
        Suspect(
            cause=cause,
            steps=tuple(steps[column] for column in columns),
            finding=finding(data, columns, variance, nothing),
        )
        for (cause, _), columns in groups.items()
    ]
    suspects.sort(key=lambda suspect: -suspect.finding.log_bayes)
    return Screening(about=about, steps=tuple(steps), data=data, nothing=nothing, suspects=tuple(suspects))


def prior(steps: Sequence[Step], calibrated: Sequence[str]) -> Float64[np.ndarray, " P"]:
    """Variances, in steps squared, where nothing is missing."""
    spread = dict.fromkeys(calibrated, CALIBRATED) | dict.fromkeys(NUMERICS, NUMERIC)
    return np.array([spread.get(step.cause, HABITS) ** 2 for step in steps])


def _places(trials: Trials) -> Float64[np.ndarray, "S 2"]:
    """Where something might be: the corners of the inner half of where the object was."""
    seen = np.concatenate([push.before.points[:, :2] for push in trials.study.pushes])
    low, high = np.quantile(seen, [0.25, 0.75], axis=0)
    return np.array([[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])], np.float64)
