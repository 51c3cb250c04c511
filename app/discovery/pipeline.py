"""The whole pipeline, from a study to its results: each stage a function with a typed result."""

import time
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import NamedTuple, final

import jax
import numpy as np
from jaxtyping import Float64
from threadpoolctl import threadpool_limits

from app.core.dialogue.model_monitor_messages import VerdictKind
from app.discovery.checks.direct_checks import direct_checks
from app.discovery.checks.frames import frame_tests
from app.discovery.checks.limits import limits_of
from app.discovery.checks.placement import centre, move_back, reach_m
from app.discovery.checks.soundness import gain_limits, model_limits
from app.discovery.dataset.model_under_test import Subject, Theta, setup_of
from app.discovery.dataset.names import motion_name
from app.discovery.dataset.object_kinds import ObjectTraits
from app.discovery.dataset.study import Study
from app.discovery.experiments.next_push import CANDIDATES, next_push
from app.discovery.inference.confusion import confusions
from app.discovery.inference.decide import ModelSelection, Progress, decide
from app.discovery.inference.refine import RefinedModel
from app.discovery.inference.screen import Screening, arrows_of, refit, screen
from app.discovery.residuals.forces import FORMULA
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.simulation_batch import SimulationBatch, prepare
from app.discovery.results.case import Amount, Case, CauseResult, Gain, Limit, ResidualField
from app.discovery.results.formula_text import formula_of
from app.discovery.results.gain import Gained, measure_gain
from app.discovery.results.verdict import estimates_of, powers_of, ranking_of, sentences_of, verdict_of
from app.discovery.unexplained.formula import NO_FORCE, UnexplainedForce, fit_unexplained_force

_ARROWS = 40
"""Drawn for each push."""
_CONFUSED = 8
"""Causes, the most probable, whose confusions are shown."""
_SURVIVOR = 0.05
"""Probability above which a cause is worth a push to tell it from the others."""
_ACCEPTED = 0.9
"""Lower bound on the probability of an accepted further cause: it had to beat everything else."""
_BELOW_M = 0.004
"""Margin by which the pushing tool is below the height at which it can touch the object."""


@threadpool_limits.wrap(limits=1, user_api="blas")
def discover(study: Study, subject: Subject, said: Progress, about: Theta | None = None) -> Case:
    """Run the whole pipeline on a study of a task's simulator. `said` is called with progress; `about`: see `judge`.

    Registrations and fits are linear algebra so small that threads make it ten times slower.
    """
    stages = Stages(said)
    found = judge(study, subject, stages, about)
    predictor, trials, screening, decision = found.predictor, found.trials, found.screening, found.decision
    study, refitted = trials.study, found.about
    with stages.stage("direct checks"):
        checks = direct_checks(predictor, trials, predictor.catalogue.nominal(subject))
    with stages.stage("frames"):
        places, arrows = arrows_of(trials, screening.data, predictor, refitted)
        frames = () if trials.kind.is_poured else frame_tests(trials, places, arrows)
    with stages.stage("what is left"):
        open_ended = (
            NO_FORCE
            if trials.kind.is_poured  # Forces of the library are those over a table.
            else fit_unexplained_force(predictor, trials, screening, decision, said)
        )
    with stages.stage("gain on episodes left out"):
        verdict, names, model, gain, limits = conclude(found, open_ended)
    formula = formula_of(subject, open_ended.found) if open_ended.found and model else None
    left = float(np.maximum(open_ended.left.probability, decision.unknown))  # NaN where it was not looked for.
    ranking = ranking_of(predictor.catalogue, subject, screening, decision)
    with stages.stage("next motion"):
        rivals = _rivals(screening, decision, NO_FORCE if formula is None else open_ended)
        count = CANDIDATES["cpu" if jax.default_backend() == "cpu" else "gpu"]
        ahead = next_push(predictor, trials, rivals, count=count, height_m=subject.low_m - _BELOW_M)
    causes = _causes(predictor, ranking, names, model)
    confused = tuple(blame.effect for blame in ranking[:_CONFUSED])
    gained = _gain_text(gain.gain, subject.kind) if model is not None else ""
    case = Case(
        amount=_amount(study, subject),
        limits=limits,
        checks=checks,
        verdict=verdict,
        sentences=sentences_of(verdict, causes, gained, limits, decision.probabilities, left, formula),
        causes=causes,
        formula=formula,
        ranking=ranking,
        leftover=left,
        confused=confused,
        confusions=confusions(screening, confused),
        arrows=_arrows(trials, places, arrows),
        frames=frames,
        gain=gain.gain,
        per_episode=gain.per_episode,
        steps=gain.steps,
        examples=gain.examples,
        powers=powers_of(predictor.catalogue, subject, screening),
        next_push=ahead,
        nominal=estimates_of(predictor.catalogue, subject, decision.singles[0], None),
        about=refitted,
        extended=model.estimate if model is not None else refitted,
        estimated=model.steps[: model.own] if model is not None else (),
        covariance=model.covariance if model is not None else np.zeros((0, 0)),
        spent_s=tuple(stages.spent_s),
        setup=study.setup or setup_of(subject),
        origin_m=study.origin_m,
        kind=subject.kind.name,
    )
    return move_back(case, study.origin_m)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Judged:
    """Intermediate results that a verdict is made of.

    `trials`: its pushes about the middle of the table, the object's ends as they were found; `about`: the refitted
    nominal model.
    """

    predictor: Predictor
    trials: SimulationBatch
    about: Theta
    screening: Screening
    decision: ModelSelection
    limits: tuple[Limit, ...]


def judge(study: Study, subject: Subject, stages: "Stages", about: Theta | None = None) -> Judged:
    """Refit the nominal model, weigh every cause against it, and decide; with the limits of the study.

    `about`: the refitted nominal model, where it is known.
    """
    limits = limits_of(study, subject)
    study = centre(study, subject)
    known = subject.catalogue(origin_m=study.origin_m, reach_m=reach_m(study, subject))
    predictor, trials = Predictor(subject, known), prepare(study, subject)
    with stages.stage("nominal fit"):
        about = refit(predictor, trials) if about is None else about
    with stages.stage("screening of every cause"):
        screening = screen(predictor, trials, about)
        trials = trials.with_ends(screening.ends)
    with stages.stage("decision"):
        decision = decide(predictor, trials, screening, stages.said)
        # A liquid's numerics are so near to what they usually are that a strong effect makes the nominal model useless.
        works = decision.accepted if trials.kind.is_smooth else None
        limits = (*limits, *model_limits(trials, screening.data if works is None else works.remainder))
    return Judged(
        predictor=predictor, trials=trials, about=about, screening=screening, decision=decision, limits=limits
    )


class Conclusion(NamedTuple):
    """Verdict with the causes that it is about, the model to save, its gain, and the limits of all that."""

    verdict: VerdictKind
    names: tuple[str, ...]
    model: RefinedModel | None
    gain: Gained
    limits: tuple[Limit, ...]


def conclude(found: Judged, open_ended: UnexplainedForce) -> Conclusion:
    """The verdict; none is named, and no model extended, where that predicts worse than the nominal one."""
    decision = found.decision
    verdict, names = verdict_of(decision, found.limits, open_ended)
    model = _model(verdict, decision, open_ended)
    gain = measure_gain(found.predictor, found.trials, found.screening, model)
    extension = "the likeliest cause" if names else "the force that was found"
    in_use = gain_limits(gain.gain, found.trials.kind, None if model is None else extension)
    limits = (*found.limits, *in_use)
    if model is None or not gain.gain.is_loss:
        return Conclusion(verdict, names, model, gain, limits)
    is_set = verdict == "set"
    return Conclusion(verdict if is_set else "none", names if is_set else (), None, gain.without_extension(), limits)


def _model(verdict: VerdictKind, decision: ModelSelection, open_ended: UnexplainedForce) -> RefinedModel | None:
    """Model to save: that of the verdict's formula, or of its causes."""
    if verdict == "none":
        return None
    return open_ended.found.model if open_ended.found else decision.accepted


@final
class Stages:
    """Clock of the pipeline: reports the running stage, and keeps the duration of each [s]."""

    def __init__(self, said: Progress) -> None:
        self.said = said
        self.spent_s = list[tuple[str, float]]()

    @contextmanager
    def stage(self, name: str) -> Generator[None]:
        """Count what happens inside as time of this stage."""
        self.said(name)
        began = time.perf_counter()
        yield
        self.spent_s.append((name, time.perf_counter() - began))


def _amount(study: Study, subject: Subject) -> Amount:
    pushes = study.pushes
    return Amount(
        task=study.task,
        episodes=len({push.episode for push in pushes}),
        pushes=len(pushes),
        during=sum(bool(push.during) for push in pushes),
        measured=sum(push.measured is not None for push in pushes),
        particles=subject.particle_count,
    )


def _causes(
    predictor: Predictor, ranking: tuple[CauseResult, ...], names: tuple[str, ...], model: RefinedModel | None
) -> tuple[CauseResult, ...]:
    """Causes of the verdict; if several act together, with the sizes of the model that has them all."""
    found = [next(blame for blame in ranking if blame.effect == name) for name in names]
    if model is None or len(model.causes) == 1:
        return tuple(found)
    return tuple(
        replace(
            blame,
            estimates=estimates_of(predictor.catalogue, predictor.subject, model, blame.effect),
            probability=max(blame.probability, _ACCEPTED),
        )
        for blame in found
    )


def _rivals(
    screening: Screening, decision: ModelSelection, open_ended: UnexplainedForce
) -> dict[str, tuple[float, Theta]]:
    """Hypotheses that are still probable, with their models."""
    rivals = {
        model.causes[0]: (decision.probabilities[model.causes[0]], model.estimate)
        for model in decision.singles
        if decision.probabilities[model.causes[0]] > _SURVIVOR
    }
    if open_ended.found is not None:
        rivals[FORMULA] = (open_ended.left.probability, open_ended.found.model.estimate)
    if decision.nothing > _SURVIVOR or len(rivals) == 1:
        rivals["nothing missing"] = (max(decision.nothing, _SURVIVOR), screening.about)
    return rivals


def _gain_text(gain: Gain, kind: ObjectTraits) -> str:
    if gain.nominal_mm == 0:
        return (
            "On episodes that it was not fitted to, the nominal model errs by nothing, so that nothing can be gained."
        )
    return (
        f"On episodes that it was not fitted to, the extended model errs by {gain.extended_mm:.1f} {kind.unit} a "
        f"{motion_name(kind.name)} where the nominal one errs by {gain.nominal_mm:.1f} {kind.unit} (gain "
        f"{100 * gain.gain:.0f} %, 90 % interval {100 * gain.low:.0f} to {100 * gain.high:.0f} %)."
    )


def _arrows(
    trials: SimulationBatch, places: Float64[np.ndarray, "K N 2"], arrows: Float64[np.ndarray, "K N 2"]
) -> ResidualField:
    """Evenly chosen along the object, so many a push; none of what is compared by amounts."""
    if trials.kind.is_poured:
        nothing = np.zeros((0, 2), np.float32)
        return ResidualField(places=nothing, displacements=nothing, push=nothing[:, 0], along=nothing[:, 0])
    count = places.shape[1]
    order = np.argsort(trials.labels[:, :, 0], axis=1)
    chosen = order[:, np.linspace(0, count - 1, min(_ARROWS, count)).round().astype(int)]
    pick = np.arange(len(places))[:, None], chosen
    push = np.broadcast_to(pick[0], chosen.shape)
    return ResidualField(
        places=places[pick].reshape(-1, 2).astype(np.float32),
        displacements=arrows[pick].reshape(-1, 2).astype(np.float32),
        push=push.ravel().astype(np.float32),
        along=trials.labels[:, :, 0][pick].ravel(),
    )
