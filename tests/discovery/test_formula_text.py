"""Formulas in words: a swirl, a drag or a pull is called so, in real units and about the right point."""

import pytest

from app.discovery.dataset.model_under_test import catalogue
from app.discovery.residuals.forces import FORMULA, with_formula
from app.discovery.results.case import Formula
from app.discovery.results.formula_text import formula_of
from app.discovery.unexplained.formula import AcceptedFormula
from app.jobs.discovery_subject import subject_of
from app.tasks import load
from tests.discovery.exact import exact_model

SUBJECT, CATALOGUE = subject_of(load("rope_push")), catalogue()
FASTER, HEAVIER = SUBJECT.time_scale, SUBJECT.gravity_scale


def said(*features: str, **values: float) -> Formula:
    """Formula of an exact fit of these features, with these values of the simulator's parameters."""
    known = with_formula(CATALOGUE, features)
    model = exact_model(SUBJECT, known, (FORMULA,), values)
    return formula_of(SUBJECT, AcceptedFormula(features=features, model=model, catalogue=known))


def about(x: float, y: float, swirl: float) -> dict[str, float]:
    """A swirl about a point: the push at the middle of the workspace makes the force vanish at that point."""
    return {"swirl": swirl, "push_x": swirl * y, "push_y": -swirl * (x - 0.55)}


def test_a_swirl_says_where_which_way_and_how_strong() -> None:
    found = said("swirl", **about(0.48, 0.07, -8 / 9.81))
    assert found.words == "A force that swirls about (0.48, 0.07) m, clockwise, 8 1/s^2."
    assert found.text == "f / (m g) = -0.815/m n x (x - (0.48, 0.07) m)"
    (term,) = found.terms
    where = {it.name: it for it in term.estimates if it.unit == "m"}
    assert where["about_x"].value == pytest.approx(0.48)
    assert where["about_x"].low < 0.48 < where["about_x"].high


def test_what_spreads_and_swirls_has_one_middle() -> None:
    found = said("swirl", "spread", swirl=0.5, spread=-0.5, push_x=0.0, push_y=0.05)
    assert "pulls towards (0.50, 0.05) m" in found.words
    assert "swirls about (0.50, 0.05) m, counter-clockwise" in found.words


def test_what_vanishes_at_no_point_of_the_table_is_about_none() -> None:
    found = said("swirl", swirl=0.01, push_x=0.1, push_y=0.0)
    assert "about no point" in found.words
    assert "(0.1, 0)" in found.text


@pytest.mark.parametrize(
    ("feature", "values", "words"),
    [
        ("push", {"push_x": 0.0, "push_y": 0.12}, "A push by 12% of the weight, 90 degrees from x."),
        ("drag", {"drag": 4.0 * HEAVIER / FASTER}, "Drag in proportion to speed, 4 1/s."),
        (
            "drag_squared",
            {"drag_squared": 40.0 * HEAVIER / FASTER**2},
            "Drag that grows with the square of speed, 40 1/m.",
        ),
        ("sideways", {"sideways": -0.15}, "A pull to the right of the way by 15% of the weight, whatever the speed."),
        (
            "sideways_rate",
            {"sideways_rate": 3.0 * HEAVIER / FASTER},
            "A pull to the left of the way in proportion to speed, 3 1/s.",
        ),
        (
            "growth",
            {"growth_x": -0.2, "growth_y": 0.0},
            "In the course of the session a further push by 20% of the weight, 180 degrees from x.",
        ),
    ],
)
def test_what_matches_a_template_is_said_in_its_words(feature: str, values: dict[str, float], words: str) -> None:
    assert said(feature, **values).words == words


def test_several_terms_are_a_sum() -> None:
    found = said("drag_squared", "sideways", drag_squared=20.0, sideways=0.1)
    assert [len(term.estimates) for term in found.terms] == [1, 1]
    assert found.text.startswith("f / (m g) = -4.25 s^2/m^2 |v| v + 0.1 n x v/|v|")
