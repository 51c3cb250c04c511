"""Gain of an extended model on episodes that it was not fitted to, used as by a planner.

A planner knows commands and not the arm's execution of them; so here both models are given the commanded tracks.
Errors are the mean length of the displacement field between the predicted and the observed object.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float32, Float64

from app.core.types import Points
from app.discovery.dataset.model_under_test import Theta
from app.discovery.inference.decide import theta_of
from app.discovery.inference.held_out import left_out_thetas
from app.discovery.inference.mixed_effects import fit_mixed_effects
from app.discovery.inference.refine import RefinedModel
from app.discovery.inference.screen import Screening
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.sensitivity import apply_step
from app.discovery.residuals.simulation_batch import SimulationBatch
from app.discovery.results.case import Example, Gain
from app.sim.model.numerics import POUR_NUMERICS

Clouds: TypeAlias = Float32[np.ndarray, "K N 3"]
"""The object after each push [m]."""

_HORIZON = 3
_EXAMPLES = 6
_DRAWS = 2000
_MM = 1e3


class Gained(NamedTuple):
    """The gain with its details. See `Case`."""

    gain: Gain
    per_episode: Float64[np.ndarray, "E 2"]
    steps: Float64[np.ndarray, "S 2"]
    examples: tuple[Example, ...]

    def without_extension(self) -> "Gained":
        """The same where no extended model is used."""
        nominal = self.gain.nominal_mm
        none = 0.0 if nominal > 0 else float("nan")
        return Gained(
            gain=replace(self.gain, extended_mm=nominal, gain=none, low=none, high=none),
            per_episode=self.per_episode[:, [0, 0]],
            steps=self.steps[:, [0, 0]],
            examples=tuple(replace(each, extended=each.nominal) for each in self.examples),
        )


class Folds(NamedTuple):
    """Nominal and extended models for each episode, fitted to the others, numerics of a liquid included."""

    nominal: Mapping[int, Theta]
    extended: Mapping[int, Theta]


def measure_gain(
    predictor: Predictor, trials: SimulationBatch, screening: Screening, model: RefinedModel | None
) -> Gained:
    """Errors over one push and over several, of a liquid over one alone, with and without the extension."""
    folds = folds_of(predictor, screening, model)
    planned = _as_planned(trials)
    ends = [_predict(predictor, planned, folds.nominal)]
    ends.append(ends[0] if model is None else _predict(predictor, planned, folds.extended))
    still = _errors_mm(planned, np.stack([push.before.points for push in trials.study.pushes]))
    errors = np.stack([_errors_mm(planned, end) for end in ends], axis=1)
    # A push that the simulation does not survive is as good as one of which it says that nothing moves.
    errors = np.where(np.isfinite(errors), errors, still[:, None])
    steps = [errors.mean(0), *_further(predictor, planned, folds, ends)]
    numbers = np.unique(screening.data.episode)
    per_episode = np.stack([errors[screening.data.episode == number].mean(0) for number in numbers])
    low, high = _interval(per_episode)
    nominal, extended = errors.mean(0)
    return Gained(
        gain=Gain(
            still_mm=float(still.mean()),
            nominal_mm=float(nominal),
            extended_mm=float(extended),
            gain=float(1 - extended / nominal) if nominal > 0 else float("nan"),
            low=low,
            high=high,
            episodes=len(numbers),
        ),
        per_episode=per_episode,
        steps=np.stack(steps),
        examples=_examples(planned, ends, errors),
    )


def folds_of(predictor: Predictor, screening: Screening, model: RefinedModel | None) -> Folds:
    """The models of each episode, as the others have them; without a model, the extended one is the nominal one."""
    catalogue, subject = predictor.catalogue, predictor.subject
    fitted = {*subject.calibrated, *(POUR_NUMERICS if subject.kind.is_poured else ())}
    own = [n for n, step in enumerate(screening.steps) if step.cause in fitted]
    data, prior = screening.data, screening.prior
    nominal = dict[int, Theta]()
    for number in np.unique(data.episode).tolist():
        rest = data.without(number)
        if not own:
            nominal[number] = screening.about
            continue
        fit = fit_mixed_effects(replace(rest, J=rest.J[:, :, own]), prior.variance[own], prior.mean[own])
        theta = screening.about
        for n, share in zip(own, np.clip(fit.theta, -1, 1), strict=True):
            theta = apply_step(catalogue, theta, screening.steps[n], float(share))
        nominal[number] = theta
    if model is None:
        return Folds(nominal, nominal)
    extended = dict[int, Theta]()
    for number, shares in left_out_thetas(model).items():
        theta = theta_of(catalogue, model, shares[: model.own])
        for step, share in zip(model.steps[model.own :], shares[model.own :], strict=True):
            if step.cause in POUR_NUMERICS:  # What they were without the cause made up for it.
                theta = apply_step(catalogue, theta, step, float(share))
        extended[number] = theta
    return Folds(nominal, extended)


def _as_planned(trials: SimulationBatch) -> SimulationBatch:
    """The trials with commands alone, without measured tracks."""
    pushes = tuple(replace(push, measured=None) for push in trials.study.pushes)
    return replace(trials, study=replace(trials.study, pushes=pushes))


def _predict(predictor: Predictor, trials: SimulationBatch, thetas: Mapping[int, Theta]) -> Clouds:
    """Predicted object after each push (K, N, 3), by the model of its episode."""
    episode = np.array([push.episode for push in trials.study.pushes])
    numbers = list(thetas)
    where = np.stack([episode == number for number in numbers])
    found = predictor(trials, [thetas[number] for number in numbers], where=where).after
    return found[where.argmax(0), np.arange(len(episode))]


def _errors_mm(trials: SimulationBatch, predicted: Clouds) -> Float64[np.ndarray, " K"]:
    return np.array([error_mm(trials, k, cloud) for k, cloud in enumerate(predicted)])


def error_mm(trials: SimulationBatch, k: int, predicted: Points) -> float:
    """Mean length of the displacement from the prediction to the observation."""
    if not np.isfinite(predicted).all():
        return float("nan")
    if trials.bowls is not None:
        return _MM * float(np.linalg.norm(trials.gap(k, "after", predicted, trials.observed.after[k])))
    basis = trials.basis(k, "after", predicted)
    field = basis.field(trials.gap(k, "after", predicted, trials.observed.after[k]))
    return _MM * float(np.linalg.norm(field, axis=1).mean())


def _further(
    predictor: Predictor, trials: SimulationBatch, folds: Folds, ends: Sequence[Clouds]
) -> list[Float64[np.ndarray, "2"]]:
    """Mean errors over two and more pushes, each begun where the one before it was predicted to end.

    None of a liquid: what cameras would show of it is no place where it could be (`PouredBowls.with_share`).
    """
    if trials.bowls is not None:
        return []
    episode = np.array([push.episode for push in trials.study.pushes])
    errors = list[Float64[np.ndarray, "2"]]()
    starts = [{k: (k, cloud) for k, cloud in enumerate(end)} for end in ends]
    for _ in range(1, _HORIZON):
        row = list[float]()
        for side, thetas in enumerate(folds):
            if side == 1 and folds.extended is folds.nominal:
                row.append(row[0])
                continue
            follow = [
                k
                for k in starts[side]
                if k + 1 < len(episode) and episode[k + 1] == episode[k] and np.isfinite(starts[side][k][1]).all()
            ]
            if not follow:
                return errors
            chained = trials.begun_from({k + 1: starts[side][k] for k in follow})
            found = _predict(predictor, chained, thetas)
            row.append(float(np.nanmean(_errors_mm(chained, found))))
            starts[side] = {k + 1: (starts[side][k][0], cloud) for k, cloud in zip(follow, found, strict=True)}
        errors.append(np.array(row))
    return errors


def _interval(per_episode: Float64[np.ndarray, "E 2"]) -> tuple[float, float]:
    """Interval of the gain, 90 %: a bootstrap over episodes, of those draws in which the nominal model errs at all."""
    rng = np.random.default_rng(0)
    drawn = per_episode[rng.integers(len(per_episode), size=(_DRAWS, len(per_episode)))].mean(1)
    drawn = drawn[drawn[:, 0] > 0]
    if not len(drawn):
        return float("nan"), float("nan")
    low, high = np.quantile(1 - drawn[:, 1] / drawn[:, 0], [0.05, 0.95])
    return float(low), float(high)


def _examples(
    trials: SimulationBatch, ends: Sequence[Clouds], errors: Float64[np.ndarray, "K 2"]
) -> tuple[Example, ...]:
    """Pushes from the most to the least improved, evenly spread: no selection of the best."""
    order = np.argsort(errors[:, 1] - errors[:, 0])
    order = order[np.isfinite(errors[order]).all(1)]
    chosen = order[np.unique(np.linspace(0, len(order) - 1, _EXAMPLES).round().astype(int))]
    return tuple(
        Example(
            number=int(k),
            before=trials.study.pushes[k].before.points,
            observed=trials.observed.after[k],
            nominal=ends[0][k],
            extended=ends[1][k],
            tool=trials.study.pushes[k].command.positions,
        )
        for k in chosen
    )
