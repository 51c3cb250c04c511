"""Names, units and digits as people read them."""

import re

import pytest

from app.core.dialogue import words as dialogue
from app.discovery.dataset.model_under_test import catalogue
from app.report.drawing import words

CATALOGUE = catalogue()


@pytest.mark.parametrize("effect", [cause.name for cause in CATALOGUE.causes])
def test_every_effect_has_a_name_without_underscores_made_from_its_id(effect: str) -> None:
    name = words.effect_name(effect)
    assert "_" not in name
    parts = [part for part in effect.split("_") if part != "tcp"]
    assert all(part in re.split(r"\W+", name.lower()) for part in parts)
    assert words.title(effect)[0].isupper()


def test_names_differ() -> None:
    names = [words.effect_name(cause.name) for cause in CATALOGUE.causes]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("spec", CATALOGUE.specs, ids=lambda spec: spec.name)
def test_every_unit_of_the_catalogue_is_shown_and_keeps_the_value(spec) -> None:
    value = spec.typical or spec.high
    shown = words.display(spec.unit, value)
    assert shown.symbol or spec.unit == "1"
    number = words.quantity(value, spec.unit).split(shown.symbol or " ")[0].replace(words.MINUS, "-")
    assert float(number) / shown.factor == pytest.approx(value, rel=0.06)


@pytest.mark.parametrize(
    ("numbers", "unit", "shown"),
    [
        ((0.0041, 0.0036, 0.0046), "m", "4.1 mm (3.6 to 4.6)"),
        ((0.55312, 0.541, 0.563), "m", "0.553 m (0.541 to 0.563)"),
        ((0.061, 0.0552, 0.0674), "s", "61 ms (55 to 67)"),
        ((0.0174533, 0.0157, 0.0192), "rad", "1.00° (0.90 to 1.10)"),
        ((-0.82, -1.4, -0.2), "deg", f"{words.MINUS}0.8° ({words.MINUS}1.4 to {words.MINUS}0.2)"),
        ((23123.0, 19900.0, 26300.0), "Pa", "23 kPa (20 to 26)"),
        ((0.312, 0.12, 0.5), "1/session", "0.31 per session (0.12 to 0.50)"),
        ((736.0, 690.0, 790.0), "1/s", "740 s⁻¹ (690 to 790)"),
        ((0.0013, 0.0004, 0.0021), "1/Pa", "1.3 kPa⁻¹ (0.4 to 2.1)"),
    ],
)
def test_numbers_have_the_digits_that_their_interval_supports(
    numbers: tuple[float, float, float], unit: str, shown: str
) -> None:
    assert words.measurement(*numbers, unit) == shown


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_what_is_not_finite_is_a_dash(value: float) -> None:
    assert words.quantity(value, "m") == words.NOTHING
    assert words.best(value, value, value, "s") == words.NOTHING
    assert words.percent(value) == words.NOTHING


def test_a_number_without_an_interval_is_still_shown() -> None:
    assert words.best(0.0062, 0.0062, 0.0062, "m") == "6.2 mm"
    assert words.best(0.0062, -float("inf"), float("inf"), "m") == "6.2 mm"


@pytest.mark.parametrize(
    ("share", "said"), [(0.0, "< 1 %"), (0.004, "< 1 %"), (0.5, "50 %"), (0.996, "> 99 %"), (1.0, "> 99 %")]
)
def test_a_probability_is_never_rounded_to_certainty(share: float, said: str) -> None:
    assert dialogue.probability(share) == said


def test_there_is_no_minus_zero() -> None:
    assert words.decimal(-0.004, 1) == "0.0"


def test_alternatives_and_companions_are_listed_as_people_do() -> None:
    assert words.names(("stribeck", "viscous_film"), "or") == "Stribeck friction or viscous film"
    assert words.names(("table_tilt", "tcp_offset", "draught"), "and") == (
        "table tilt, tool-centre-point offset and draught"
    )
