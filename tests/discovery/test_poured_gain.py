"""The gain on episodes that were left out, of liquids: what is fitted to the others, and what is not measured."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.types import Points
from app.discovery.inference.mixed_effects import fit_mixed_effects
from app.discovery.inference.screen import Screening, screening_about
from app.discovery.inference.weighing import Prior
from app.discovery.residuals.poured_contents import CONTENTS
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.rows import Block, Residuals
from app.discovery.residuals.sensitivity import steps_of
from app.discovery.residuals.simulation_batch import PushParticles, SimulationBatch, prepare
from app.discovery.results.gain import folds_of, measure_gain
from app.report.sections.verdict import gain_sentence
from tests.discovery.exact import exact_model
from tests.discovery.pours import SUBJECT, study_of, water

KNOWN = SUBJECT.catalogue()
PREDICTOR = Predictor(SUBJECT, KNOWN)
OUTFLOW = KNOWN.column("outflow")
EPISODES, POURS = 5, 4
ODD = EPISODES - 1
"""The episode in which more flows out than in the others."""


def screened(outflow: float, pours: int = POURS) -> Screening:
    """Screening about a model with this outflow, of pours in which it is 0.2, and 1.2 in the odd episode."""
    about, steps = KNOWN.nominal(SUBJECT), [step for step in steps_of(KNOWN, (), {}) if step.cause == "outflow"]
    about[OUTFLOW] = outflow
    episode = np.repeat(np.arange(EPISODES), pours)
    slopes = np.zeros((len(episode), 2 * CONTENTS, 1))
    slopes[:, CONTENTS:] = np.random.default_rng(0).uniform(0.01, 0.03, (len(episode), CONTENTS, 1))
    true = np.where(episode == ODD, 1.2, 0.2)
    noise = 1e-4 * np.random.default_rng(1).normal(size=(len(episode), 2 * CONTENTS))
    data = Residuals(
        r=slopes[:, :, 0] * (true - outflow)[:, None] + noise,
        J=slopes,
        spread=np.zeros((len(episode), 2 * CONTENTS, 1)),
        known=np.arange(2 * CONTENTS) >= np.full((len(episode), 1), CONTENTS),
        episode=episode,
        blocks=(Block(slice(0, 2 * CONTENTS)),),
    )
    return screening_about(KNOWN, (), about, steps, data)


@pytest.mark.parametrize("outflow", [0.4, 0.9])
def test_what_flows_out_is_fitted_to_the_other_episodes(outflow: float) -> None:
    folds = folds_of(PREDICTOR, screened(outflow), None)
    assert folds.nominal[ODD][OUTFLOW] == pytest.approx(0.2, abs=0.02)
    assert folds.extended is folds.nominal


def test_what_flows_out_with_a_cause_is_not_what_made_up_for_it_without() -> None:
    without = screened(0.9)
    alone = exact_model(SUBJECT, KNOWN, ("liquid_viscosity",), {"outflow": 0.9})
    slopes, about = without.data.J, 0.9 - 0.3
    J = np.concatenate([np.zeros((*slopes.shape[:2], alone.own)), slopes], axis=2)
    data = replace(without.data, r=-about * slopes[:, :, 0], J=J)
    prior = Prior(mean=np.zeros(alone.own + 1), variance=np.ones(alone.own + 1), nuisance=(alone.own,))
    model = replace(
        alone,
        steps=(*alone.steps, *without.steps),
        data=data,
        prior=prior,
        fit=fit_mixed_effects(data, prior.variance),
    )
    folds = folds_of(PREDICTOR, without, model)
    assert set(folds.extended) == set(folds.nominal)
    assert folds.nominal[ODD][OUTFLOW] == pytest.approx(0.2, abs=0.02)
    for theta in folds.extended.values():
        assert theta[OUTFLOW] == pytest.approx(0.3, abs=0.02)


def predict_as(monkeypatch: pytest.MonkeyPatch, clouds: list[Points]) -> None:
    """Predictions of every model: that pours end in these clouds."""

    def predict(_: Predictor, trials: SimulationBatch, thetas: list[object], **_more: object) -> PushParticles:
        ends = np.broadcast_to(np.stack(clouds[: len(trials)]), (len(thetas), len(trials), *clouds[0].shape))
        return PushParticles(ends, ends)

    monkeypatch.setattr(Predictor, "__call__", predict)


def test_where_nothing_is_poured_the_model_has_no_error_and_nothing_is_gained(monkeypatch: pytest.MonkeyPatch) -> None:
    place = np.array([0.42, 0.05, 0.144])
    predict_as(monkeypatch, [water(0.3, place)] * EPISODES)
    trials = prepare(study_of(*[(0.3, 0.3)] * EPISODES), SUBJECT)
    gain = measure_gain(PREDICTOR, trials, screened(0.2, pours=1), None).gain
    assert gain.nominal_mm == 0
    assert np.isnan([gain.gain, gain.low, gain.high]).all()
    assert "errs by nothing on 5 held-out episodes" in gain_sentence(gain)


def test_an_interval_is_of_draws_in_which_there_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    place = np.array([0.42, 0.05, 0.144])
    predict_as(monkeypatch, [water(0.3 + 0.1 * (k == ODD), place) for k in range(EPISODES)])
    trials = prepare(study_of(*[(0.3, 0.3)] * EPISODES), SUBJECT)
    gain = measure_gain(PREDICTOR, trials, screened(0.2, pours=1), None).gain
    assert (gain.gain, gain.low, gain.high) == (0.0, 0.0, 0.0)


def test_pours_are_not_chained_as_an_observation_of_a_liquid_is_no_beginning(monkeypatch: pytest.MonkeyPatch) -> None:
    shares, place = [(0.0, 0.3), (0.3, 0.7)] * EPISODES, np.array([0.42, 0.05, 0.144])
    predict_as(monkeypatch, [water(after - 0.1, place) for _, after in shares])
    trials = prepare(study_of(*shares, pours=2), SUBJECT)
    found = measure_gain(PREDICTOR, trials, screened(0.2, pours=2), None)
    assert found.steps.shape == (1, 2)
    assert found.gain.nominal_mm == pytest.approx(10.0, abs=0.5)
