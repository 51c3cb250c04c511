"""Evidence about a refit's own estimate: for a cause that is there, against one that is not, and none without data."""

from dataclasses import replace

import numpy as np
import pytest

from app.discovery.dataset.model_under_test import catalogue
from app.discovery.inference.mixed_effects import fit_mixed_effects
from app.discovery.inference.refine import RefinedModel, local_log_bayes, own_steps
from app.discovery.inference.screen import Screening
from app.discovery.inference.weighing import log_evidence
from app.discovery.residuals.sensitivity import steps_of
from app.jobs.discovery_subject import subject_of
from app.tasks import load
from tests.discovery.exact import exact_model
from tests.discovery.made_up import screening

SUBJECT, CATALOGUE = subject_of(load("rope_push")), catalogue()
NULL_SD = 0.1
"""Deviation of a tilt, in typical sizes, where nothing is wrong."""


def screened() -> Screening:
    """A screening that asked about a tilt along x, and y; the calibrated parameters are known to a step of a refit."""
    made = screening(lambda rng: rng.normal(size=(60, 16, 4)))
    known = {step.column: step.size for step in own_steps(CATALOGUE, SUBJECT.calibrated, ())}
    wanted = {*SUBJECT.calibrated, "table_tilt"}
    steps = [step for step in steps_of(CATALOGUE, SUBJECT.calibrated, {}) if step.cause in wanted]
    deviations = np.array([known.get(step.column, NULL_SD * step.size) / step.size for step in steps])
    prior = replace(made.prior, mean=np.zeros(len(steps)), variance=deviations**2)
    return replace(made, steps=tuple(steps), prior=prior, about=CATALOGUE.nominal(SUBJECT))


def refitted(size: float, *, blind: bool = False) -> RefinedModel:
    """A refit of tilt along x of so many typical sizes, by data that say it or, if `blind`, nothing of it."""
    full = next(step.size for step in screened().steps if step.column == CATALOGUE.column("tilt_x"))
    model = exact_model(SUBJECT, CATALOGUE, ("table_tilt",), {"tilt_x": size * full})
    own = np.array([step.cause == "table_tilt" for step in model.steps])
    data = replace(model.data, J=model.data.J * ~own) if blind else model.data
    shares = np.array([step.size / full for step in model.steps])
    far = np.array([size if step.column == CATALOGUE.column("tilt_x") else 0.0 for step in model.steps])
    prior = replace(
        model.prior,
        mean=np.where(own, -far / shares, 0.0),
        variance=np.where(own, (1 + NULL_SD**2) / shares**2, 1.0),
    )
    fit = fit_mixed_effects(data, prior.variance, prior.mean)
    return replace(model, data=data, prior=prior, fit=fit, log_evidence=log_evidence(fit, prior, 1.0))


@pytest.mark.parametrize("size", [-1.0, 1.0])
def test_a_cause_far_from_its_null_has_evidence_by_the_simulations_about_it(size: float) -> None:
    assert local_log_bayes(CATALOGUE, screened(), refitted(size)) > 30


def test_an_estimate_within_its_null_speaks_against_the_cause() -> None:
    assert -6 < local_log_bayes(CATALOGUE, screened(), refitted(NULL_SD)) < -1


def test_data_that_say_nothing_of_a_cause_speak_neither_for_it_nor_against_it() -> None:
    assert local_log_bayes(CATALOGUE, screened(), refitted(1.0, blind=True)) == pytest.approx(0.0, abs=0.1)
