"""Soundness of the model: on made-up pushes, no cause is named by a model that does not work."""

from dataclasses import replace

import numpy as np
import pytest

from app.discovery.checks.soundness import gain_limits, model_limits
from app.discovery.dataset.model_under_test import catalogue
from app.discovery.dataset.object_kinds import LIQUID, ROPE
from app.discovery.inference.decide import is_sized
from app.discovery.residuals.displacement_field import MODES
from app.discovery.residuals.rows import Residuals
from app.discovery.results.case import Gain
from app.jobs.discovery_subject import subject_of
from app.tasks import load
from tests.discovery.exact import exact_model
from tests.discovery.test_steppers import trials

SUBJECT, CATALOGUE = subject_of(load("rope_push")), catalogue()


def residuals(error_m: float, simulated: float = 1.0) -> Residuals:
    """Residuals of the pushes of `trials`: each off by `error_m`, and a share of them `simulated`."""
    count, rows = len(trials()), 4 * MODES
    r, known = np.zeros((count, rows)), np.ones((count, rows), bool)
    r[:, 2 * MODES] = error_m
    known[round(simulated * count) :] = False
    empty = np.zeros((count, rows, 0))
    return Residuals(r=r, J=empty, spread=empty, known=known, episode=np.arange(count), blocks=())


def test_a_model_that_predicts_pushes_carries_a_name() -> None:
    assert not list(model_limits(trials(), residuals(1e-3)))


def test_one_that_is_no_better_than_no_motion_does_not() -> None:
    (limit,) = model_limits(trials(), residuals(1.0))
    assert limit.fatal
    assert "one in which nothing moves errs by" in limit.text


def test_nor_do_pushes_of_which_only_some_could_be_simulated() -> None:
    found = list(model_limits(trials(), residuals(1e-3, simulated=0.5)))
    assert found[0].fatal
    assert found[0].text == "Only 1 of 2 pushes could be simulated."


def gain(nominal_mm: float, extended_mm: float, *, low: float, high: float, still_mm: float = 70.0) -> Gain:
    share = 1 - extended_mm / nominal_mm
    return Gain(
        still_mm=still_mm,
        nominal_mm=nominal_mm,
        extended_mm=extended_mm,
        gain=share,
        low=low,
        high=high,
        episodes=5,
    )


WORSE = {
    "surely worse": gain(45.0, 77.0, low=-0.82, high=-0.6),
    "something from nothing": replace(gain(1.0, 40.0, low=float("nan"), high=float("nan")), nominal_mm=0.0),
    "no better than no motion": gain(65.0, 72.0, low=-0.3, high=-0.02),
}
FAIR = {
    "better": gain(20.0, 15.0, low=0.1, high=0.4),
    "much better, of a model that explained little": gain(50.0, 15.0, low=0.6, high=0.8),
    "surely worse by little": gain(3.6, 3.9, low=-0.12, high=-0.04),
    "perhaps worse by much": gain(60.0, 68.0, low=-0.3, high=0.1),
    "about as good": gain(20.0, 20.6, low=-0.1, high=0.02),
    "without an error to gain from": gain(1e-9, 1e-9, low=float("nan"), high=float("nan")),
}


@pytest.mark.parametrize("found", WORSE.values(), ids=WORSE)
def test_a_cause_with_which_left_out_episodes_are_predicted_worse_is_not_named(found: Gain) -> None:
    (limit,) = gain_limits(found, ROPE, "a tilt")
    assert f"With a tilt the model errs by {found.extended_mm:.1f} mm a push" in limit.text
    assert not any("tilt" in each.text for each in gain_limits(found, ROPE, None))


@pytest.mark.parametrize("found", FAIR.values(), ids=FAIR)
def test_one_that_does_not_harm_may_be_named(found: Gain) -> None:
    assert not any("a tilt" in each.text for each in gain_limits(found, ROPE, "a tilt"))


def test_a_model_that_explains_little_of_the_motion_says_so_in_the_words_of_its_object() -> None:
    (limit,) = gain_limits(gain(50.0, 45.0, low=0.0, high=0.2), LIQUID, "a tilt")
    assert "errs by 50.0 % of the liquid a pour" in limit.text


@pytest.mark.parametrize(
    ("value", "there"), [(2.0, True), (0.0, False), (None, False)], ids=["there", "not there", "at its end"]
)
def test_a_cause_is_there_if_its_interval_says_so_and_its_range_does_not_end_there(
    value: float | None, there: bool
) -> None:
    spec = CATALOGUE.specs[CATALOGUE.column("tilt_x")]
    assert spec.typical is not None
    tilt = spec.high if value is None else value * spec.typical
    model = exact_model(SUBJECT, CATALOGUE, ("table_tilt",), {"tilt_x": tilt})
    assert is_sized(CATALOGUE, replace(model, estimate=model.theta)) is there
