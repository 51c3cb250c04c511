"""Other methods on the same recordings: `python -m bench.hidden.baselines -o FILE RECORDINGS...`

A process of its own. They are given discovery's residuals, slopes about its refitted nominal model, and for causes with
a place the place that its screening chose, so that each takes seconds; rows are scaled by how much they scatter.

- `all_at_once`: squared residuals over all parameters together, as users of system identification would minimise them,
  by differential evolution within twice typical sizes and a last descent (Storn and Price 1997, "Differential evolution
  - a simple and efficient heuristic for global optimization over continuous spaces"). It blames what is largest.
- `bic`: each cause alone fitted with what is unknown of every rope, and weighed by Schwarz's criterion (1978,
  "Estimating the dimension of a model") with equal chances, all rows taken to be independent.
"""

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from jaxtyping import Float64
from scipy.optimize import differential_evolution
from scipy.special import softmax
from threadpoolctl import threadpool_limits

from app.commands._named import Dynamics, full_name
from app.discovery.inference.decide import NAMED
from app.discovery.inference.screen import CandidateCause, Screening, refit, screen
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.simulation_batch import prepare
from app.discovery.results.case import CauseResult
from app.discovery.results.verdict import estimate_of
from app.jobs.discovery_subject import subject_of
from app.report.drawing.size import size
from app.services.study import read_study
from app.tasks import load

TITLES: Final = {"all_at_once": "all parameters at once", "bic": "BIC of single causes"}
_MISSING: Final = 0.5
"""Typical sizes from which a fit of all parameters at once is taken to say that something is missing."""
_MOST: Final = 2.0
"""Bound on sizes, in typical ones; of every rope's unknowns, in steps."""
_SET: Final = 0.9
_LEAST_M: Final = 1e-4
_MEDIAN: Final = 0.6745
"""Median of the absolute value of a standard normal variable."""
_ROUNDS, _CROWD = 150, 4
"""Generations, and members for each parameter."""
_PLACE: Final = 2
"""Parameters of a place, which a cause that has one costs besides."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Linear:
    """Residuals as a linear model: of all rows, scaled and independent, squared lengths about theta.

    n rows with the squares c - 2 b theta + theta A theta; `nuisance`: columns that are no cause.
    """

    A: Float64[np.ndarray, "P P"]
    b: Float64[np.ndarray, " P"]
    c: float
    n: int
    nuisance: tuple[int, ...]
    suspects: tuple[CandidateCause, ...]

    @classmethod
    def of(cls, screening: Screening) -> "Linear":
        """Linear model with each row divided by its usual size after discovery's own fit of every rope's unknowns."""
        data = screening.data
        seen = data.known.any(0)
        usual = np.ones(data.r.shape[1])
        usual[seen] = np.nanmedian(np.where(data.known, np.abs(data.r), np.nan)[:, seen], axis=0) / _MEDIAN
        weight = data.known / np.maximum(usual, _LEAST_M)
        J, r = (data.J * weight[:, :, None]).reshape(-1, data.J.shape[2]), (data.r * weight).ravel()
        return cls(
            A=J.T @ J,
            b=J.T @ r,
            c=float(r @ r),
            n=int(data.known.sum()),
            nuisance=screening.prior.nuisance,
            suspects=screening.suspects,
        )

    def fit(self, columns: Sequence[int]) -> tuple[Float64[np.ndarray, " Q"], Float64[np.ndarray, "Q Q"], float]:
        """Least squares of some columns, their inverse information, and the residuals."""
        own = list(columns)
        inverse = np.linalg.pinv(self.A[np.ix_(own, own)])
        theta = inverse @ self.b[own]
        return theta, inverse, self.c - float(self.b[own] @ theta)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Fitted:
    """A cause as a method has it: values and deviations of its columns, in steps."""

    suspect: CandidateCause
    values: Float64[np.ndarray, " Q"]
    deviations: Float64[np.ndarray, " Q"]
    probability: float


def all_at_once(linear: Linear, seed: int = 0) -> tuple[str, list[str], list[Fitted]]:
    """The kind of verdict, its causes, and all of them, the largest first. A fit states no doubt: it is sure."""
    columns = [*linear.nuisance, *(column for suspect in linear.suspects for column in suspect.columns)]
    signed = {
        column: 0.0 if step.sides == 1 else -_MOST
        for suspect in linear.suspects
        for column, step in zip(suspect.columns, suspect.steps, strict=True)
    }
    bounds = [(signed.get(column, -_MOST), _MOST) for column in columns]
    A, b = linear.A[np.ix_(columns, columns)], linear.b[columns]

    def loss(theta: Float64[np.ndarray, "P ..."]) -> Float64[np.ndarray, " ..."]:
        return (theta * (A @ theta)).sum(0) - 2 * b @ theta

    found = differential_evolution(
        loss, bounds, maxiter=_ROUNDS, popsize=_CROWD, rng=seed, vectorized=True, updating="deferred", polish=True
    ).x
    value = dict(zip(columns, found.tolist(), strict=True))
    deviation = np.sqrt(np.diag(np.linalg.pinv(A)) * max(linear.c + float(loss(found)), 0.0) / linear.n)
    spread = dict(zip(columns, deviation.tolist(), strict=True))
    fits = [
        Fitted(
            suspect=suspect,
            values=np.array([value[column] for column in suspect.columns]),
            deviations=np.array([spread[column] for column in suspect.columns]),
            probability=0.0,
        )
        for suspect in linear.suspects
    ]
    fits.sort(key=lambda fit: -float(np.linalg.norm(fit.values)))
    largest = fits[0]
    if np.linalg.norm(largest.values) < _MISSING:
        return "none", [], fits
    return "named", [largest.suspect.cause], [replace(largest, probability=1.0), *fits[1:]]


def bic(linear: Linear) -> tuple[str, list[str], list[Fitted]]:
    """The kind of verdict, its causes, and all of them, the most probable first."""
    nuisance = list(linear.nuisance)
    criteria, found = [_criterion(linear, linear.fit(nuisance)[2], len(nuisance))], list[Fitted]()
    for suspect in linear.suspects:
        theta, inverse, left = linear.fit([*nuisance, *suspect.columns])
        own = slice(len(nuisance), None)
        placed = _PLACE * bool(suspect.steps[0].given)
        criteria.append(_criterion(linear, left, len(theta) + placed))
        deviations = np.sqrt(np.diag(inverse)[own] * left / linear.n)
        found.append(Fitted(suspect=suspect, values=theta[own], deviations=deviations, probability=0.0))
    chances = softmax(-0.5 * np.array(criteria))
    fits = [replace(found[at], probability=float(chances[1 + at])) for at in np.argsort(-chances[1:])]
    if chances[0] >= chances[1:].max():
        return "none", [], fits
    if fits[0].probability > NAMED:
        return "named", [fits[0].suspect.cause], fits
    mass = np.cumsum([chances[0], *(fit.probability for fit in fits)])
    return "set", [fit.suspect.cause for fit in fits[: int((mass < _SET).sum())]], fits


def _criterion(linear: Linear, left: float, parameters: int) -> float:
    return linear.n * float(np.log(max(left, 1e-9) / linear.n)) + parameters * float(np.log(linear.n))


@threadpool_limits.wrap(limits=1, user_api="blas")
def verdicts(recordings: Sequence[Path], dynamics: Dynamics) -> dict[str, Any]:
    """Conclusions of each method, in the format of `verdict.json` as far as scores need them."""
    study = read_study(recordings)
    subject = subject_of(load(full_name(study.task, dynamics=dynamics)))
    known, began = subject.catalogue(), time.perf_counter()
    predictor, trials = Predictor(subject, known), prepare(study, subject)
    screening = screen(predictor, trials, refit(predictor, trials))
    linear, prepared_s = Linear.of(screening), time.perf_counter() - began
    found = dict[str, Any]()
    for name, method in (("all_at_once", all_at_once), ("bic", bic)):
        began = time.perf_counter()
        kind, causes, fits = method(linear)
        entries = [_entry(predictor, screening, fit) for fit in fits]
        found[name] = {
            "verdict": kind,
            "causes": [entry for entry in entries if entry["effect"] in causes],
            "ranking": entries,
            "heldout": {"nominal": None, "extended": None},
            "amount": {"pushes": len(study.pushes)},
            "spent_s": [
                {"stage": "screening of every cause", "seconds": prepared_s},
                {"stage": "fit", "seconds": time.perf_counter() - began},
            ],
        }
    return found


def _entry(predictor: Predictor, screening: Screening, fit: Fitted) -> dict[str, Any]:
    cause = predictor.catalogue.cause(fit.suspect.cause)
    columns = zip(fit.suspect.steps, fit.values.tolist(), fit.deviations.tolist(), strict=True)
    estimates = tuple(
        estimate_of(
            predictor.catalogue,
            predictor.subject,
            step.column,
            screening.about,
            value * step.size,
            deviation * abs(step.size),
        )
        for step, value, deviation in columns
    )
    whole = size(
        CauseResult(
            effect=cause.name,
            family=cause.family,
            about=cause.about,
            estimates=estimates,
            probability=fit.probability,
            log_bayes=0.0,
        )
    )
    return {
        "effect": cause.name,
        "family": cause.family,
        "size": whole.value,
        "low": whole.low,
        "high": whole.high,
        "probability": fit.probability,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--dynamics", choices=("rods", "mpm"), default="rods")
    options = parser.parse_args()
    found = verdicts(options.recordings, options.dynamics)
    options.output.write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
