"""Left-out episodes speak for a weak cause that is there, and for none that is not."""

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from app.discovery.inference import decide
from app.discovery.inference.decide import settle_strong, without_rivals
from app.discovery.inference.held_out import (
    HeldOutGain,
    earned_by_either,
    held_out_gain,
    held_out_gain_of_linear,
    is_earned,
    trimmed_mean,
)
from app.discovery.inference.screen import CandidateCause, Screening
from app.discovery.inference.weighing import weigh
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.simulation_batch import SimulationBatch
from app.jobs.discovery_subject import subject_of
from app.tasks import load
from tests.discovery.exact import exact_model
from tests.discovery.made_up import ALL, K, R, screening

EYES = "hand_eye_translation", "hand_eye_rotation"


def with_cause(size: float) -> tuple[Screening, CandidateCause]:
    """A screening of a world in which the first cause has this size, and that cause as a suspect."""
    about = screening(lambda rng: rng.normal(size=(K, R, 4)))
    data = replace(about.data, r=about.data.r + size * about.data.J[:, :, 1])
    weighing = weigh(data, ALL, about.prior)
    suspect = CandidateCause(cause="push", columns=(1,), steps=(about.steps[1],), finding=weighing.findings[0])
    return replace(about, data=data, weighing=weighing), suspect


@pytest.mark.parametrize("size", [-0.6, 0.6])
def test_a_weak_cause_makes_left_out_episodes_more_likely(size: float) -> None:
    held = held_out_gain_of_linear(*with_cause(size))
    assert held.gain > 0
    assert is_earned(held)


def test_a_cause_that_every_episode_shows_is_earned_however_well_the_null_hypothesis_could_learn_it() -> None:
    found, suspect = with_cause(1.3)
    loose = replace(found, prior=replace(found.prior, variance=np.maximum(found.prior.variance, 0.1**2)))
    held = held_out_gain_of_linear(loose, suspect)
    assert is_earned(held)
    assert held.gain > 0.5 * suspect.finding.log_bayes / len(np.unique(found.data.episode))


def test_a_cause_that_another_does_nearly_alike_is_asked_about_without_it() -> None:
    found, suspect = with_cause(1.0)
    slopes = found.data.J.copy()
    slopes[:, :, 2] = 10 * slopes[:, :, 1] + np.random.default_rng(1).normal(scale=1e-4, size=slopes.shape[:2])
    loose = replace(found.prior, variance=np.maximum(found.prior.variance, 0.1**2))
    alike = replace(found, data=replace(found.data, J=slopes), prior=loose)
    confused, alone = held_out_gain_of_linear(alike, suspect), held_out_gain_of_linear(alike, suspect, [1, 2])
    assert alone.gain > 2 * max(confused.gain, 0.0)
    assert is_earned(alone)


def test_a_second_error_of_the_arm_is_earned_although_the_model_of_the_first_could_learn_it() -> None:
    task = load("rope_push")
    subject = subject_of(task)
    known = subject.catalogue()
    one = exact_model(subject, known, ("under_reach",), {"under_reach": 0.02})
    both = exact_model(subject, known, ("under_reach", "actuator_lag"), {"under_reach": 0.02, "actuator_lag": 0.03})
    data = replace(both.data, r=both.data.r + 0.5 * both.data.J[:, :, -1])
    # What the first model has of the second: a column that is nearly held at nothing.
    variance = np.append(np.ones(both.own - 1), 1e-2)
    one = replace(one, data=data, prior=replace(both.prior, variance=variance), steps=both.steps, own=both.own - 1)
    both = replace(both, data=data)
    learnt = held_out_gain((one.data, one.prior), both)
    alone, larger = (without_rivals(known, each, "actuator_lag") for each in (one, both))
    assert not is_earned(learnt)
    assert is_earned(held_out_gain((alone.data, alone.prior), larger))


@pytest.mark.parametrize("gain", [-1.0, 5.0])
def test_a_single_cause_stands_where_two_are_not_borne_out(monkeypatch: pytest.MonkeyPatch, gain: float) -> None:
    subject = subject_of(load("rope_push@mpm"))
    known = subject.catalogue()
    one = exact_model(subject, known, ("under_reach",), {"under_reach": 0.02})
    both = exact_model(subject, known, ("under_reach", "actuator_lag"), {"under_reach": 0.02, "actuator_lag": 0.03})
    found, _ = with_cause(1.0)
    suspect = CandidateCause(
        cause="under_reach", columns=(1,), steps=(found.steps[1],), finding=found.weighing.findings[0]
    )
    monkeypatch.setattr(decide, "refit_cause", lambda *_, **_more: one)
    monkeypatch.setattr(decide, "_add_causes", lambda *_: both)
    gains = {one.causes: HeldOutGain(gain=5.0, error=1.0), both.causes: HeldOutGain(gain=gain, error=1.0)}
    monkeypatch.setattr(decide, "held_out_gain", lambda _, model: gains[model.causes])
    predictor, trials = Predictor(subject, known), Mock(spec=SimulationBatch)
    selected = decide.decide(predictor, trials, replace(found, suspects=(suspect,)), lambda _: None)
    assert selected.accepted is (both if gain > 1.0 else one)
    assert selected.held == gains[selected.accepted.causes]


@pytest.mark.parametrize("task", ["pour_water", "pour_soup"])
@pytest.mark.parametrize(
    ("surplus", "gain", "stands"),
    [(30.0, 0.5, True), (30.0, -0.5, True), (5.0, 0.5, False), (30.0, -1.5, False), (5.0, 1.5, True)],
)
def test_the_evidence_of_a_liquid_is_enough_where_left_out_episodes_do_not_contradict_it(
    monkeypatch: pytest.MonkeyPatch, task: str, surplus: float, gain: float, stands: bool
) -> None:
    subject = subject_of(load(task))
    known = subject.catalogue()
    found, _ = with_cause(1.0)
    finding = found.weighing.findings[0]._replace(log_bayes=60.0)
    suspect = CandidateCause(cause="fill_level", columns=(1,), steps=(found.steps[1],), finding=finding)
    one = exact_model(subject, known, ("fill_level",), {"fill_level": 0.1})
    one = replace(one, log_evidence=found.weighing.log_evidence + surplus)
    monkeypatch.setattr(decide, "refit_cause", lambda *_, **_more: one)
    monkeypatch.setattr(decide, "_add_causes", lambda *_: one)
    monkeypatch.setattr(decide, "held_out_gain", lambda *_: HeldOutGain(gain=gain, error=1.0))
    predictor, trials = Predictor(subject, known), Mock(spec=SimulationBatch)
    selected = decide.decide(predictor, trials, replace(found, suspects=(suspect,)), lambda _: None)
    assert (selected.accepted is one) == (stands if task == "pour_water" else gain > 1)


@pytest.mark.parametrize(("task", "first"), [("pour_water", "finger_friction"), ("pour_soup", "fill_level")])
def test_strong_causes_of_a_liquid_are_weighed_by_their_refits(task: str, first: str) -> None:
    subject = subject_of(load(task))
    known = subject.catalogue()
    found, _ = with_cause(1.0)
    linear = {"fill_level": 32.0, "finger_friction": 19.0}
    suspects = [
        CandidateCause(
            cause=name,
            columns=(1,),
            steps=(found.steps[1],),
            finding=found.weighing.findings[0]._replace(log_bayes=value),
        )
        for name, value in linear.items()
    ]
    nothing = found.weighing.log_evidence
    refits = {"fill_level": 25.0, "finger_friction": 40.0}
    models = [
        replace(exact_model(subject, known, (name,), {}), log_evidence=nothing + value)
        for name, value in refits.items()
    ]
    screened = replace(found, suspects=tuple(suspects))
    probabilities, _ = decide.probabilities_of(screened, models, subject.kind)
    assert max(probabilities, key=lambda cause: probabilities[cause]) == first


@pytest.mark.parametrize(("further", "held"), [("table_tilt", False), ("actuator_lag", True)])
def test_only_an_error_of_cameras_or_arm_is_compared_without_the_others(further: str, held: bool) -> None:
    subject = subject_of(load("rope_push"))
    known = subject.catalogue()
    both = exact_model(subject, known, ("under_reach", "actuator_lag"), {"under_reach": 0.02, "actuator_lag": 0.03})
    model = replace(both, own=both.own - 1)
    variance = without_rivals(known, model, further).prior.variance
    assert (variance[-1] < model.prior.variance[-1]) == held
    assert np.array_equal(variance[:-1], model.prior.variance[:-1])


def test_a_cause_that_is_absent_does_not() -> None:
    assert not is_earned(held_out_gain_of_linear(*with_cause(0.0)))


def test_a_cause_that_moves_nothing_does_not() -> None:
    found, suspect = with_cause(0.4)
    slopes = found.data.J.copy()
    slopes[:, :, 1] = 0.0
    assert not is_earned(held_out_gain_of_linear(replace(found, data=replace(found.data, J=slopes)), suspect))


def test_a_cause_is_earned_by_the_screening_alone_only_where_its_refit_does_not_contradict_it() -> None:
    unsure, sure = HeldOutGain(gain=0.4, error=0.4), HeldOutGain(gain=5.0, error=0.6)
    assert earned_by_either(unsure, sure, refit_evidence=25.0) == sure
    assert earned_by_either(unsure, sure, refit_evidence=-15.0) == unsure
    assert earned_by_either(sure, unsure, refit_evidence=-15.0) == sure
    assert earned_by_either(unsure, unsure, refit_evidence=25.0) == unsure


@pytest.mark.parametrize("count", [5, 10, 20])
def test_where_nothing_is_gained_a_gain_is_earned_as_rarely_as_by_two_standard_errors(count: int) -> None:
    gains = np.random.default_rng(count).normal(size=(4000, count))
    plain = gains.mean(1) > 2 * gains.std(1, ddof=1) / np.sqrt(count)
    earned = [is_earned(trimmed_mean(each)) for each in gains]
    assert np.mean(earned) == pytest.approx(np.mean(plain), abs=0.015)


@pytest.mark.parametrize("outlier", [-150.0, 150.0])
def test_one_episode_that_ends_otherwise_does_not_outweigh_nine(outlier: float) -> None:
    gains = np.append(np.random.default_rng(0).normal(8.0, 3.0, 9), outlier)
    assert gains.mean() < 2 * gains.std(ddof=1) / np.sqrt(10)  # By two standard errors of the mean it would.
    assert is_earned(trimmed_mean(gains))


def test_one_episode_earns_nothing() -> None:
    assert not is_earned(trimmed_mean(np.array([80.0])))


@pytest.mark.parametrize(
    ("evidence", "promised", "noise_m", "shares"),
    [
        (1900.0, 660.0, 5e-3, (0.0, 0.99)),
        (1720.0, 660.0, 5e-3, (0.94, 0.05)),
        (1900.0, 1870.0, 5e-3, (0.94, 0.05)),
        (1900.0, 660.0, 1e-3, (0.94, 0.05)),
        (1500.0, 660.0, 1e-3, (0.94, 0.05)),
        (1500.0, 660.0, 1e-4, (0.99, 0.0)),
    ],
    ids=[
        "told by refits",
        "by no more than chaos",
        "likeliest is badly refitted",
        "no episode bears it out",
        "likeliest is better by its evidence alone",
        "likeliest is better",
    ],
)
def test_refits_tell_strong_errors_of_cameras_from_each_other(
    evidence: float, promised: float, noise_m: float, shares: tuple[float, float]
) -> None:
    subject = subject_of(load("rope_push"))
    known = subject.catalogue()
    shift, turn = (exact_model(subject, known, (cause,), {}) for cause in EYES)
    # What a shift leaves of the data; a turn leaves a millimetre.
    left = replace(shift.data, r=noise_m * np.random.default_rng(1).normal(size=shift.data.r.shape))
    shift, turn = replace(shift, data=left, log_evidence=1680.0), replace(turn, log_evidence=evidence)
    turn = replace(
        turn, estimate=turn.estimate + 0.5 * (np.arange(len(turn.estimate)) == known.column("hand_eye_turn_x"))
    )
    probabilities = {EYES[0]: 0.94, EYES[1]: 0.05, "draught": 0.005}
    found = settle_strong(known, probabilities, [shift, turn], {EYES[0]: promised, EYES[1]: 490.0})
    assert (found[EYES[0]], found[EYES[1]]) == pytest.approx(shares)
    assert found["draught"] == probabilities["draught"]


def test_a_turn_that_is_not_there_by_its_interval_rules_nothing_out() -> None:
    subject = subject_of(load("rope_push"))
    shift, turn = (exact_model(subject, subject.catalogue(), (cause,), {}) for cause in EYES)
    left = replace(shift.data, r=5 * shift.data.r)
    shift, turn = replace(shift, data=left, log_evidence=1680.0), replace(turn, log_evidence=1900.0)
    probabilities = {EYES[0]: 0.94, EYES[1]: 0.05}
    assert settle_strong(subject.catalogue(), probabilities, [shift, turn], dict.fromkeys(EYES, 0.0)) == probabilities
