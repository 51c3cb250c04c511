"""Refit of causes taken for present, with friction and stiffness: Gauss-Newton about their estimates.

The screening's slopes are those about the nominal model; what is strong, or acts at a place, needs slopes about itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from jaxtyping import Float64

from app.discovery.dataset.model_under_test import Catalogue, Theta
from app.discovery.inference.mixed_effects import Covariances, MixedEffectsFit, fit_mixed_effects
from app.discovery.inference.screen import CandidateCause, Screening
from app.discovery.inference.weighing import Prior, log_evidence, posterior
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.rows import Residuals
from app.discovery.residuals.sensitivity import Step, apply_step, residuals, switch_of
from app.discovery.residuals.simulation_batch import SimulationBatch

_ROUNDS = 5
_PART = 0.4
"""Factor on a screening's step: slopes about a fitted value are taken over less."""
_SHARE = 0.05
"""Share of its range that is a step of a place, time or shape parameter; its prior's deviation is five of them."""
_DEVIATION = 5.0
_FARTHEST = 3.0
"""Steps at most in a round."""
_SETTLED = 0.15


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class RefinedModel:
    """Model with causes taken for present, at their estimates, about which everything else is linear.

    `own`: the first columns of the data, those of the causes and of the calibrated parameters; the rest are the
    screening's. `estimate`: `theta` moved by the fit, by the share of it that is trusted.
    """

    causes: tuple[str, ...]
    theta: Theta
    estimate: Theta
    steps: tuple[Step, ...]
    own: int
    data: Residuals
    prior: Prior
    fit: MixedEffectsFit
    log_evidence: float
    temperature: float
    trust: float = 1.0

    @property
    def remainder(self) -> Residuals:
        """The data with what is left by the fit, of all columns, as residuals."""
        return replace(self.data, r=self.data.r - self.data.J @ self.fit.theta)

    @property
    def covariance(self) -> Float64[np.ndarray, "Q Q"]:
        """Covariance of the own columns, in their steps."""
        return posterior(self.fit, self.prior, self.temperature)[: self.own, : self.own]


def refine(
    predictor: Predictor,
    trials: SimulationBatch,
    screening: Screening,
    starts: Sequence[tuple[str, Theta]],
    noises: Sequence[Covariances] = (),
    *,
    rounds: int = _ROUNDS,
) -> RefinedModel:
    """The best model with these causes; each start is a cause and a theta that has it.

    Where a step makes the data less likely, half of it is tried. It is linear about `rounds` models at most.
    """
    catalogue = predictor.catalogue
    causes = tuple(name for name, _ in starts)
    theta = _join(catalogue, screening.about, starts)
    own = own_steps(catalogue, predictor.subject.calibrated, causes)
    best: RefinedModel | None = None
    for _ in range(rounds):
        sloped = residuals(predictor, trials, theta, own, replicas=0)
        model = _fit_linear(catalogue, screening, causes, theta, own, sloped, noises)
        if best is None or model.log_evidence > best.log_evidence:
            best = model
        else:
            best = replace(best, trust=best.trust / 2, estimate=_ahead(catalogue, best, best.trust / 2))
        theta = best.estimate
        if best.trust * float(np.abs(best.fit.theta[: len(own)]).max()) < _SETTLED:
            break
    assert best is not None
    return best


def _ahead(catalogue: Catalogue, model: RefinedModel, share: float) -> Theta:
    """The model's theta moved by a share of its fit."""
    estimate = model.theta
    shares = np.clip(model.fit.theta[: model.own], -_FARTHEST, _FARTHEST)
    for step, value in zip(model.steps[: model.own], shares, strict=True):
        estimate = apply_step(catalogue, estimate, step, share * float(value))
    return estimate


def start_of(catalogue: Catalogue, about: Theta, suspect: CandidateCause, *, share: float = 1.0) -> Theta:
    """The model with a suspect's cause as the screening found it."""
    theta = about.copy()
    for step, value in zip(suspect.steps, suspect.finding.mean, strict=True):
        theta = apply_step(catalogue, theta, step, share * float(value))
    return theta


def own_steps(catalogue: Catalogue, calibrated: Sequence[str], causes: Sequence[str]) -> tuple[Step, ...]:
    """Steps of the calibrated parameters and of everything that these causes have."""
    steps = [Step(cause=name, column=catalogue.column(name), size=0.3 * _PART, sides=2) for name in calibrated]
    for name in causes:
        cause = catalogue.cause(name)
        for column in cause.columns[: cause.switches]:
            full = switch_of(catalogue, cause, column)
            steps.append(replace(full, size=_PART * full.size, sides=2))
        for column in cause.columns[cause.switches :]:
            spec = catalogue.specs[column]
            size = _SHARE * (spec.coordinate(spec.high) - spec.coordinate(spec.low))
            steps.append(Step(cause=name, column=column, size=size, sides=2))
    return tuple(steps)


def _join(catalogue: Catalogue, about: Theta, starts: Sequence[tuple[str, Theta]]) -> Theta:
    """One theta with the parameters of each cause from its own start."""
    theta = about.copy()
    if len(starts) == 1:
        return starts[0][1].copy()
    for name, start in starts:
        columns = list(catalogue.cause(name).columns)
        theta[columns] = start[columns]
    return theta


def _fit_linear(
    catalogue: Catalogue,
    screening: Screening,
    causes: tuple[str, ...],
    theta: Theta,
    own: tuple[Step, ...],
    sloped: Residuals,
    noises: Sequence[Covariances],
) -> RefinedModel:
    present = {step.column for step in own}
    others = [n for n, step in enumerate(screening.steps) if step.column not in present]
    base = screening.data
    # What cannot be simulated with the cause is left as the nominal model predicts it: evidence is of the same rows.
    data = Residuals(
        r=np.where(sloped.known, sloped.r, base.r),
        J=np.concatenate([sloped.J, base.J[:, :, others]], axis=2),
        spread=base.spread,
        known=base.known,
        episode=base.episode,
        blocks=base.blocks,
    )
    prior = _prior(catalogue, screening, theta, own, others)
    weighing = screening.weighing
    fit = fit_mixed_effects(data, prior.variance, prior.mean, (weighing.nothing.covariances, None, *noises))
    model = RefinedModel(
        causes=causes,
        theta=theta,
        estimate=theta,
        steps=(*own, *(screening.steps[n] for n in others)),
        own=len(own),
        data=data,
        prior=prior,
        fit=fit,
        log_evidence=log_evidence(fit, prior, weighing.temperature),
        temperature=weighing.temperature,
    )
    return replace(model, estimate=_ahead(catalogue, model, 1.0))


def _prior(
    catalogue: Catalogue, screening: Screening, theta: Theta, own: tuple[Step, ...], others: Sequence[int]
) -> Prior:
    """Prior of all columns in steps from theta, the own ones first; flat for calibrated ones."""
    mean, variance = np.zeros(len(own)), np.empty(len(own))
    full = {step.column: (step.size, n) for n, step in enumerate(screening.steps)}
    for n, step in enumerate(own):
        spec = catalogue.specs[step.column]
        size, at = full.get(step.column, (0.0, -1))
        here = spec.coordinate(float(theta[step.column]))
        if at < 0:  # Where, when or how: anywhere in the range, more likely in its middle.
            middle = (spec.coordinate(spec.low) + spec.coordinate(spec.high)) / 2
            mean[n], variance[n] = (middle - here) / step.size, _DEVIATION**2
        elif step.cause in catalogue_names(catalogue):
            mean[n] = (spec.coordinate(spec.nominal) - here) / step.size
            variance[n] = (1 + screening.prior.variance[at]) * (size / step.size) ** 2
        else:
            centre = spec.coordinate(float(screening.about[step.column]))
            mean[n] = (centre - here) / step.size
            variance[n] = screening.prior.variance[at] * (size / step.size) ** 2
    return Prior(
        mean=np.concatenate([mean, screening.prior.mean[list(others)]]),
        variance=np.concatenate([variance, screening.prior.variance[list(others)]]),
        nuisance=tuple(range(len(own)))
        + tuple(len(own) + n for n, at in enumerate(others) if at in screening.prior.nuisance),
    )


def catalogue_names(catalogue: Catalogue) -> frozenset[str]:
    """Names of all causes."""
    return frozenset(cause.name for cause in catalogue.causes)
