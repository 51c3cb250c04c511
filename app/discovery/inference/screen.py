"""The first verdict, from one batch of simulations: a refitted nominal model, and every cause weighed against it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import final

import numpy as np
from jaxtyping import Float64

from app.discovery.dataset.model_under_test import Catalogue, Family, Theta
from app.discovery.inference.ends import Ends, find_ends, turn_rows
from app.discovery.inference.localize import Located, likeliest_places
from app.discovery.inference.mixed_effects import fit_mixed_effects
from app.discovery.inference.weighing import (
    CALIBRATED,
    Z90,
    HypothesisResult,
    ModelComparison,
    Prior,
    null_prior,
    weigh,
)
from app.discovery.residuals.forces import FORMULA, columns_of_features, force_steps, with_formula
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.rows import Residuals
from app.discovery.residuals.sensitivity import STARTS, Step, apart, apply_step, hypotheses_of, residuals, steps_of
from app.discovery.residuals.simulation_batch import SimulationBatch
from app.sim.model.numerics import ANY_NUMERICS, POUR_NUMERICS, ROD_NUMERICS
from app.sim.parameter import NullPrior

_REFITS = 5
_SETTLED = 0.2
"""Steps of 30 %, below which a refit is done."""
_FAR = 2.0
"""Steps of a calibrated parameter that a refit takes at most."""
_PEAKS = 8
_PEAK_M = 0.03
"""Number of places with large residuals, where something may be in the way, and their least distance [m]."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class CandidateCause:
    """A cause with its result of the screening; `columns`: its own in the data, with their `steps`.

    `finding.mean` are their values in steps.
    """

    cause: str
    columns: tuple[int, ...]
    steps: tuple[Step, ...]
    finding: HypothesisResult


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Screening:
    """All causes, the most probable first, about the refitted nominal model; a placed cause where it fits best.

    `ends`: which end of the object is the first in each episode; in `data` slopes are as with these. `force`: the rival
    of them all, a force of no known cause, as the feature that fits best, with the evidence of their mean; of rods.
    """

    about: Theta
    steps: tuple[Step, ...]
    data: Residuals
    prior: Prior
    weighing: ModelComparison
    suspects: tuple[CandidateCause, ...]
    ends: Ends
    force: CandidateCause | None = None

    @property
    def causes(self) -> tuple[CandidateCause, ...]:
        """The causes of the catalogue, and the force of none."""
        return self.suspects if self.force is None else (*self.suspects, self.force)


def refit(predictor: Predictor, trials: SimulationBatch) -> Theta:
    """The nominal model with the calibrated parameters that fit these pushes, and of rods the unknown ones, too."""
    catalogue, calibrated = predictor.catalogue, predictor.subject.calibrated
    own = _fitted_first(predictor)
    about, starts = catalogue.nominal(predictor.subject), 1 if predictor.subject.is_ensemble else STARTS
    for turn in range(_REFITS):
        prior = prior_of(catalogue, calibrated, about, own)
        sloped = residuals(predictor, trials, about, own, replicas=2, starts=starts)
        found = fit_mixed_effects(sloped, prior.variance, prior.mean)
        before = about
        for step, share in zip(own, np.clip(found.theta, -_FAR, _FAR), strict=True):
            about = apply_step(catalogue, about, step, float(share))
        settled = max(abs(apart(catalogue, before, about, step)) for step in own) < _SETTLED
        if settled and starts == STARTS:
            break
        if settled or turn == _REFITS - 2:  # The way there needs no more than one beginning of each push.
            starts = STARTS
    return about


def _fitted_first(predictor: Predictor) -> list[Step]:
    """Steps of the calibrated parameters, and of the unknown ones of a rod or a liquid."""
    subject = predictor.subject
    calibrated, of_rods, poured = subject.calibrated, subject.rods is not None, subject.kind.is_poured
    wanted = {*calibrated, *(ROD_NUMERICS if of_rods else ()), *(POUR_NUMERICS if poured else ())}
    return [step for step in steps_of(predictor.catalogue, calibrated, {}) if step.cause in wanted]


def screen(
    predictor: Predictor, trials: SimulationBatch, about: Theta, *, only: Sequence[str] | None = None
) -> Screening:
    """Weigh every cause, or those of `only`, against the refitted nominal model."""
    catalogue, calibrated = predictor.catalogue, predictor.subject.calibrated
    wanted = None if only is None else {*only, *calibrated, *ANY_NUMERICS}
    located = located_of(predictor, trials, about, only)
    places = {cause: found.places for cause, found in located.items()}
    steps = [step for step in steps_of(catalogue, calibrated, places) if wanted is None or step.cause in wanted]
    if catalogue.rods and wanted is None:
        steps += force_steps(catalogue)
    data = residuals(predictor, trials, about, steps)
    costs = {cause: found.cost for cause, found in located.items()}
    return screening_about(catalogue, calibrated, about, steps, data, costs)


def screening_about(
    catalogue: Catalogue,
    calibrated: Sequence[str],
    about: Theta,
    steps: Sequence[Step],
    data: Residuals,
    costs: Mapping[str, float] = MappingProxyType({}),
) -> Screening:
    """Screening of every cause by residuals and slopes about a model. `costs` [nats]: of a place chosen from many."""
    prior = prior_of(catalogue, calibrated, about, steps)
    odd_columns = {column for cause in catalogue.causes for column in cause.odd}
    odd = [n for n, step in enumerate(steps) if step.column in odd_columns]
    ends = find_ends(data, prior, odd)
    data, chosen = turn_rows(data, ends, odd), (len(ends) - 1) * np.log(2)
    asked = list[tuple[str, list[int], float]]()
    features = columns_of_features(steps)
    free = (n for n, step in enumerate(steps) if n not in prior.nuisance and step.cause != FORMULA)
    for (cause, _), columns in hypotheses_of(steps, free).items():
        even = [column for column in columns if column not in odd]
        asked.append((cause, columns, costs.get(cause, 0.0) + (chosen if len(even) < len(columns) else 0.0)))
        if 0 < len(even) < len(columns):
            asked.append((cause, even, 0.0))
    asked += [(FORMULA, list(columns), 0.0) for columns in features.values()]
    weighing = weigh(data, [columns for _, columns, _ in asked], prior)
    ways = dict[str, list[CandidateCause]]()
    for (cause, columns, cost), weighed in zip(asked, weighing.findings, strict=True):
        own = tuple(steps[column] for column in columns)
        finding = _possible(weighed._replace(log_bayes=weighed.log_bayes - cost), own)
        ways.setdefault(cause, []).append(
            CandidateCause(cause=cause, columns=tuple(columns), steps=own, finding=finding)
        )
    force = _likeliest(ways.pop(FORMULA)) if features else None
    suspects = sorted(map(_likeliest, ways.values()), key=lambda suspect: -suspect.finding.log_bayes)
    return Screening(
        about=about,
        steps=tuple(steps),
        data=data,
        prior=prior,
        weighing=weighing,
        suspects=tuple(suspects),
        ends=ends,
        force=force,
    )


def _likeliest(ways: Sequence[CandidateCause]) -> CandidateCause:
    """The best of the places, or ways, that a cause was asked about in, with the mean evidence of all of them.

    It has one that nobody knows, and the best of many is good by chance.
    """
    best = max(ways, key=lambda suspect: suspect.finding.log_bayes)
    mean = np.logaddexp.reduce([suspect.finding.log_bayes for suspect in ways]) - np.log(len(ways))
    return replace(best, finding=best.finding._replace(log_bayes=float(mean)))


def _possible(finding: HypothesisResult, steps: Sequence[Step]) -> HypothesisResult:
    """A cause that only a value beyond its null would explain is not one."""
    beyond = all(step.sides == 1 and value < 0 for step, value in zip(steps, finding.mean, strict=True))
    return finding._replace(log_bayes=min(finding.log_bayes, 0.0)) if beyond else finding


def prior_of(catalogue: Catalogue, calibrated: Sequence[str], about: Theta, steps: Sequence[Step]) -> Prior:
    """Prior over all columns under the null hypothesis (no effect present), in steps from `about`."""
    families: dict[str, Family] = {cause.name: cause.family for cause in with_formula(catalogue).causes}
    usual = np.array(
        [
            _known_beforehand(catalogue, about, step)
            if step.cause in calibrated
            else null_prior(
                families[step.cause], catalogue.specs[step.column], rods=catalogue.rods, kind=catalogue.kind
            )
            for step in steps
        ]
    )
    here = [float(about[step.column]) / step.size if step.cause in ANY_NUMERICS else 0.0 for step in steps]
    return Prior(
        mean=usual[:, 0] - here,
        variance=usual[:, 1] ** 2,
        nuisance=tuple(n for n, step in enumerate(steps) if step.cause in calibrated or step.cause in ANY_NUMERICS),
    )


def _known_beforehand(catalogue: Catalogue, about: Theta, step: Step) -> NullPrior:
    """Mean and deviation of a calibrated parameter, in steps from `about`: of its prior, or else practically flat."""
    for prior in catalogue.priors:
        if catalogue.column(prior.name) == step.column:
            low, here, high, now = map(
                catalogue.specs[step.column].coordinate,
                (prior.low, prior.value, prior.high, float(about[step.column])),
            )
            return (here - now) / step.size, (high - low) / (2 * Z90 * step.size)
    return 0.0, CALIBRATED


def located_of(
    predictor: Predictor, trials: SimulationBatch, about: Theta, only: Sequence[str] | None = None
) -> Mapping[str, Located]:
    """Candidate places of each cause that has one: from a lattice for rods, guessed from residuals otherwise."""
    catalogue, calibrated = predictor.catalogue, predictor.subject.calibrated
    placed = [cause.name for cause in catalogue.causes if cause.placed and (only is None or cause.name in only)]
    if not placed:
        return {}
    if not catalogue.rods:
        guessed = _candidate_places(predictor, trials, about)
        return {cause: Located(guessed, 0.0) for cause in placed}
    nuisances = _fitted_first(predictor)
    return likeliest_places(
        predictor, trials, about, placed, nuisances, prior_of(catalogue, calibrated, about, nuisances)
    )


def _candidate_places(predictor: Predictor, trials: SimulationBatch, about: Theta) -> Float64[np.ndarray, "S 2"]:
    """Candidate places: the corners of the inner half of the object's region, and peaks of the residuals."""
    seen = np.concatenate([push.before.points[:, :2] for push in trials.study.pushes])
    low, high = np.quantile(seen, [0.25, 0.75], axis=0)
    corners = [[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])]
    places, arrows = arrows_of(trials, residuals(predictor, trials, about, [], replicas=0), predictor, about)
    return np.array(corners + _peaks(places.reshape(-1, 2), np.linalg.norm(arrows, axis=2).ravel()), np.float64)


def arrows_of(
    trials: SimulationBatch, data: Residuals, predictor: Predictor, about: Theta
) -> tuple[Float64[np.ndarray, "K N 2"], Float64[np.ndarray, "K N 2"]]:
    """Predicted positions of the object's points after each push, and displacements to the observed ones [m]."""
    predicted = predictor(trials, [about]).after[0]
    arrows = np.zeros((*predicted.shape[:2], 2))
    for k, cloud in enumerate(predicted):
        if np.isfinite(cloud).all() and trials.bowls is None:
            arrows[k] = trials.basis(k, "after", cloud).field(data.r[k, trials.after_rows])[:, :2]
    return np.nan_to_num(predicted[:, :, :2].astype(np.float64)), arrows


def _peaks(places: Float64[np.ndarray, "M 2"], size: Float64[np.ndarray, " M"]) -> list[list[float]]:
    """Places around which residuals are larger than elsewhere."""
    low = places.min(0)
    cells = np.floor((places - low) / _PEAK_M).astype(int)
    grid = np.zeros(cells.max(0) + 1)
    count = np.zeros_like(grid)
    np.add.at(grid, tuple(cells.T), size)
    np.add.at(count, tuple(cells.T), 1)
    usual = np.median(size)
    excess = np.where(count > 0, grid - usual * count, 0.0)
    found = list[list[float]]()
    for flat in np.argsort(excess, axis=None)[::-1]:
        place = (np.array(np.unravel_index(flat, grid.shape)) + 0.5) * _PEAK_M + low
        if all(np.linalg.norm(place - other) > 1.5 * _PEAK_M for other in found):
            found.append(place.tolist())
        if len(found) == _PEAKS:
            break
    return found
