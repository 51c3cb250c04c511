"""Confidence that was learnt from drawn studies: what it is made of, and what it makes of evidence."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from app.discovery.dataset.model_under_test import catalogue
from app.discovery.inference.calibration import calibration, features
from app.discovery.inference.screen import Screening, screening_about
from app.discovery.residuals.forces import force_steps, with_formula
from app.discovery.residuals.rows import Residuals
from app.discovery.residuals.sensitivity import Step, steps_of
from app.jobs.discovery_subject import subject_of
from app.tasks import load
from tests.discovery.test_inference import BLOCKS, K, R

SUBJECT = subject_of(load("rope_push@rods"))
KNOWN = catalogue(SUBJECT.rods)
PLACES = {cause.name: np.array([[0.5, 0.0], [0.6, 0.1]]) for cause in KNOWN.causes if cause.placed}
_ALL = [*steps_of(KNOWN, SUBJECT.calibrated, PLACES), *force_steps(KNOWN)]
STEPS = list({(step.cause, step.column): step for step in _ALL}.values())
"""Each parameter once, wherever and whenever it might act."""


@cache
@threadpool_limits.wrap(limits=1, user_api="blas")
def found(hidden: str | None, size: float = 1.0, seed: int = 0) -> Screening:
    """The screening of a linear world in which the first parameter of `hidden` has this size."""
    rng = np.random.default_rng(seed)
    J = 3e-3 * rng.normal(size=(K, R, len(STEPS)))
    theta = np.array([size * (step == _first(hidden)) for step in STEPS]) if hidden else np.zeros(len(STEPS))
    data = Residuals(
        r=J @ theta + 1e-3 * rng.normal(size=(K, R)),
        J=J,
        spread=np.zeros((K, R, 1)),
        known=np.ones((K, R), bool),
        episode=np.arange(K) // 6,
        blocks=BLOCKS,
    )
    return screening_about(KNOWN, SUBJECT.calibrated, KNOWN.nominal(SUBJECT), STEPS, data)


def _first(cause: str) -> Step:
    return next(step for step in STEPS if step.cause == cause)


def test_the_table_knows_every_cause_that_can_be_hidden_and_adds_up_to_one() -> None:
    probabilities, nothing = calibration().probabilities(found(None))
    assert set(probabilities) == {step.cause for step in STEPS} - set(SUBJECT.calibrated) - _nuisances()
    assert sum(probabilities.values()) + nothing == pytest.approx(1.0)
    assert calibration().biases.keys() == probabilities.keys(), (
        "learn app/discovery/inference/calibration.json anew: "
        "python -m bench.hidden.calibration LINES --studies 300 --table app/discovery/inference/calibration.json"
    )


def _nuisances() -> set[str]:
    return {cause.name for cause in KNOWN.causes if cause.family == "numerics"}


@pytest.mark.parametrize("cause", ["friction_anisotropy", "backlash"])
def test_what_is_evident_becomes_probable_and_the_more_so_the_larger_it_is(cause: str) -> None:
    small, large = (calibration().probabilities(found(cause, size))[0][cause] for size in (0.1, 2.0))
    absent = calibration().probabilities(found(None))[0][cause]
    assert absent < large
    assert small < large


def test_where_nothing_acts_no_cause_is_probable() -> None:
    for seed in range(3):
        probabilities, _ = calibration().probabilities(found(None, seed=seed))
        assert max(probabilities.values()) < 0.8


def test_causes_of_cameras_and_arm_stand_in_columns_of_their_own() -> None:
    causes, table = features(found(None))
    half = table.shape[1] // 2
    direct = np.array([with_formula(KNOWN).cause(cause).family != "physics" for cause in causes])
    assert not table[direct, :half].any()
    assert not table[~direct, half:].any()
    assert np.isfinite(table).all()


def test_a_cause_that_no_drawn_world_hid_is_believed_as_little_as_any() -> None:
    screening = found(None)
    suspect = next(each for each in screening.suspects if KNOWN.cause(each.cause).family == "physics")
    rest = tuple(each for each in screening.suspects if each is not suspect)
    other = replace(screening, suspects=(replace(suspect, cause="unheard_of"), *rest))
    probabilities, _ = calibration().probabilities(other)
    assert 0 < probabilities["unheard_of"] <= calibration().probabilities(screening)[0][suspect.cause] + 1e-12
