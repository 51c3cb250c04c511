"""The verdict for programs says what the case says, validates, and holds no number that JSON has not."""

import json
import math
from pathlib import Path

import jsonschema
import pytest

from app.report import verdict_json
from app.report.schema import json_schema
from app.report.sections.advice import advice
from app.report.sections.verdict import headline, probability
from tests.ui.report.cases import CASES, named, none

SCHEMA_FILE = Path(__file__).parents[3] / "docs" / "verdict.schema.json"
every_case = pytest.mark.parametrize("case", [make() for make in CASES.values()], ids=list(CASES))


def refuse(constant: str) -> None:
    raise AssertionError(f"{constant} is not JSON")


def test_the_documented_schema_is_that_of_the_program() -> None:
    assert SCHEMA_FILE.read_text(encoding="utf-8") == json_schema()


@every_case
def test_a_verdict_validates(case) -> None:
    jsonschema.validate(json.loads(verdict_json(case), parse_constant=refuse), json.loads(json_schema()))


@every_case
def test_numbers_are_those_of_the_case(case) -> None:
    read = json.loads(verdict_json(case))
    assert read["schema"] == 1
    assert (read["verdict"], tuple(read["sentences"])) == (case.verdict, case.sentences)
    assert (read["headline"], tuple(read["advice"])) == (headline(case), advice(case))
    said = probability(case)
    assert (read["probability"], read["probability_of"]) == (said or (None, None))
    for entries, blames in ((read["causes"], case.causes), (read["ranking"], case.ranking)):
        assert [it["effect"] for it in entries] == [it.effect for it in blames]
        assert [it["probability"] for it in entries] == [it.probability for it in blames]
        for entry, blame in zip(entries, blames, strict=True):
            numbers = [(it["name"], it["value"], it["low"], it["high"], it["unit"]) for it in entry["parameters"]]
            assert numbers == [(it.name, it.value, it.low, it.high, it.unit) for it in blame.estimates]
    assert [(it["text"], it["fatal"]) for it in read["limits"]] == [(it.text, it.fatal) for it in case.limits]
    assert [(it["stage"], it["seconds"]) for it in read["spent_s"]] == list(case.spent_s)
    assert read["amount"]["pushes"] == case.amount.pushes
    assert read["heldout"]["nominal"] == case.gain.nominal_mm
    if case.next_push is not None:
        assert read["next_push"]["track"]["poses"] == case.next_push.track.poses.tolist()
    if case.formula is not None:
        assert [term["words"] for term in read["formula"]["terms"]] == [term.words for term in case.formula.terms]


def test_what_is_infinite_or_not_a_number_is_null() -> None:
    power = {it["effect"]: it["least"] for it in json.loads(verdict_json(named()))["power"]}
    assert power["kelvin_voigt"] is None
    assert power["table_tilt"] == 0.82
    heldout = json.loads(verdict_json(none()))["heldout"]
    assert (heldout["gain"], heldout["low"], heldout["high"]) == (None, None, None)


def test_the_size_of_a_vector_is_its_length() -> None:
    cause = json.loads(verdict_json(named()))["causes"][0]
    parts = [part["value"] for part in cause["parameters"]]
    assert cause["size"] == pytest.approx(math.hypot(*parts))
    assert cause["low"] < cause["size"] < cause["high"]
    assert cause["unit"] == "m"
