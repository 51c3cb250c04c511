"""Verdicts: a decision becomes a named cause, a set or nothing, and never a name from data that cannot carry one."""

import math
from dataclasses import replace

import pytest

from app.discovery.dataset.model_under_test import catalogue
from app.discovery.inference.decide import ModelSelection
from app.discovery.inference.held_out import HeldOutGain
from app.discovery.inference.refine import RefinedModel
from app.discovery.residuals.forces import FORMULA, with_formula
from app.discovery.results.case import CauseResult, Limit
from app.discovery.results.verdict import estimates_of, sentences_of, verdict_of
from app.discovery.unexplained.formula import NO_FORCE, AcceptedFormula, UnexplainedForce
from app.discovery.unexplained.residual_test import ResidualTest
from app.jobs.discovery_subject import subject_of
from app.tasks import load
from tests.discovery.exact import exact_model

SUBJECT, CATALOGUE = subject_of(load("rope_push")), catalogue()
FATAL = Limit(text="Nothing was touched.", consequence="No cause can be named: push the object.", fatal=True)
MILD = Limit(text="One speed only.", consequence="Delay and compliance cannot be told apart.")


def model(*causes: str, values: dict[str, float] | None = None) -> RefinedModel:
    return exact_model(SUBJECT, CATALOGUE, causes, values or {})


def decision(probabilities: dict[str, float], accepted: RefinedModel | None) -> ModelSelection:
    return ModelSelection(
        singles=(),
        probabilities=probabilities,
        nothing=1 - sum(probabilities.values()),
        accepted=accepted,
        held=HeldOutGain(5.0, 1.0),
    )


SURE = decision({"table_tilt": 0.95, "draught": 0.04}, model("table_tilt"))
TORN = decision({"stribeck": 0.5, "viscous_film": 0.42, "friction_map": 0.05, "draught": 0.01}, model("stribeck"))


NOTHING_LEFT = UnexplainedForce(ResidualTest(0.1, 0.6), None)
MUCH_LEFT = UnexplainedForce(ResidualTest(0.98, 0.008), None)


def test_a_cause_that_is_probable_enough_is_named() -> None:
    assert verdict_of(SURE, [MILD], NOTHING_LEFT) == ("named", ("table_tilt",))


def test_causes_that_cannot_be_told_apart_are_a_set_no_larger_than_it_must_be() -> None:
    assert verdict_of(TORN, [], NOTHING_LEFT) == ("set", ("stribeck", "viscous_film"))


def test_of_many_causes_that_cannot_be_told_apart_a_sentence_lists_the_likeliest() -> None:
    names = ("stribeck", "viscous_film", "friction_map", "draught", "adhesion")
    few, many = (
        sentences_of("set", [blame(name) for name in chosen], "", [], TORN.probabilities, 0.1, None)[0]
        for chosen in (names[:4], names)
    )
    assert "Stribeck friction or viscous film or friction map or draught." in few
    assert "Stribeck friction or viscous film or friction map or one of 2 more." in many


def test_where_something_may_well_be_missing_but_nothing_is_sure_the_sentence_says_so() -> None:
    unsure = sentences_of("none", (), "", [], {"stribeck": 0.3, "draught": 0.4}, 0.1, None)
    assert unsure[0].startswith("Nothing can be named: something is missing with a probability of 70 %")
    assert unsure[1] == "Likeliest are draught (40 %) and Stribeck friction (30 %); a name takes 80 %."
    assert sentences_of("none", (), "", [], {"stribeck": 0.1}, 0.1, None)[0].startswith("Nothing is missing")


def blame(name: str) -> CauseResult:
    return CauseResult(effect=name, family="physics", about="", estimates=(), probability=0.2, log_bayes=5.0)


def test_what_was_not_accepted_is_not_named_however_probable() -> None:
    assert verdict_of(replace(SURE, accepted=None), [], NOTHING_LEFT) == ("none", ())


def test_data_that_cannot_carry_a_name_get_none() -> None:
    assert verdict_of(SURE, [MILD, FATAL], MUCH_LEFT) == ("none", ())
    assert "cannot carry" in sentences_of("none", (), "", [FATAL], SURE.probabilities, 0.1, None)[0]


def test_causes_that_act_together_are_named_together() -> None:
    both = model("table_tilt", "hand_eye_translation")
    found = decision({"table_tilt": 0.6, "hand_eye_translation": 0.3}, both)
    assert verdict_of(found, [], NOTHING_LEFT) == ("named", ("table_tilt", "hand_eye_translation"))


def test_what_is_left_where_no_cause_was_accepted_is_none_of_these() -> None:
    assert verdict_of(replace(SURE, accepted=None), [], MUCH_LEFT) == ("none_of_these", ())
    said = sentences_of("none_of_these", (), "", [], SURE.probabilities, 0.98, None)
    assert "no known cause" in said[0]
    assert "98 %" in said[0]


def test_what_is_left_beside_a_named_cause_is_said_and_the_cause_keeps_its_name() -> None:
    assert verdict_of(SURE, [], MUCH_LEFT) == ("named", ("table_tilt",))
    assert "Something is left" in sentences_of("named", (), "", [], SURE.probabilities, 0.98, None)[-1]


def test_where_no_force_was_looked_for_nothing_is_known_of_what_is_left_and_verdicts_are_as_without_it() -> None:
    assert math.isnan(NO_FORCE.left.probability)
    assert verdict_of(SURE, [], NO_FORCE) == verdict_of(SURE, [], NOTHING_LEFT)
    unnamed = replace(SURE, accepted=None)
    assert verdict_of(unnamed, [], NO_FORCE) == ("none", ())
    said = sentences_of("named", (), "", [], SURE.probabilities, NO_FORCE.left.probability, None)
    assert not any("Something is left" in text for text in said)


def test_a_formula_that_is_better_than_every_cause_takes_their_place() -> None:
    found = AcceptedFormula(
        features=("swirl",), model=model("table_tilt"), catalogue=with_formula(CATALOGUE, ("swirl",))
    )
    assert verdict_of(SURE, [MILD], UnexplainedForce(ResidualTest(0.98, 0.008), found)) == ("none_of_these", ())
    assert FORMULA not in {cause.name for cause in CATALOGUE.causes}


def test_forces_that_no_cause_is_are_never_named_by_themselves() -> None:
    named = {CATALOGUE.specs[column].name for cause in CATALOGUE.causes for column in cause.columns}
    assert not named & {"swirl", "push_x", "drag_squared", "sideways", "growth_x"}


@pytest.mark.parametrize(
    ("cause", "name", "value", "real"),
    [
        ("table_tilt", "tilt_x", 1.5, 1.5),
        ("hand_eye_translation", "hand_eye_y", 0.004, 0.004),
        ("viscous_film", "film_drag", 12.0, 12.0 * SUBJECT.time_scale / SUBJECT.gravity_scale),
        ("command_delay", "command_delay", 0.08, 0.08),
    ],
)
def test_sizes_are_those_of_the_real_world(cause: str, name: str, value: float, real: float) -> None:
    estimates = estimates_of(CATALOGUE, SUBJECT, model(cause, values={name: value}), cause)
    found = next(estimate for estimate in estimates if estimate.name == name)
    assert found.value == pytest.approx(real, rel=1e-6)
    assert found.low <= found.value <= found.high


def test_the_calibrated_parameters_are_no_cause() -> None:
    names = [estimate.name for estimate in estimates_of(CATALOGUE, SUBJECT, model("table_tilt"), None)]
    assert names == list(SUBJECT.calibrated)
