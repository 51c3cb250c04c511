"""The case file stands alone, its tags match, and everything that a case says is in it, escaped."""

import re
from dataclasses import replace
from html import escape
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.core.errors import UsageError
from app.discovery.dataset.names import effect_name
from app.discovery.results.case import Case, Limit, ResidualField
from app.report import write_report
from app.report.page import SECTIONS, page
from app.report.sections.advice import advice
from app.report.sections.verdict import chance, gain_sentence, headline
from tests.ui.report.cases import CASES, a_set, blame, estimate, named, none

every_case = pytest.mark.parametrize("case", [make() for make in CASES.values()], ids=list(CASES))
VOID = {"meta", "br", "hr", "input", "col"}
BYTES_BOUND = 2_000_000


class Reader(HTMLParser):
    """Follows the tags, and keeps text and attributes."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] not in ("style", "script"):
            self.text.append(data)


def read(case: Case) -> Reader:
    reader = Reader()
    reader.feed(page(case))
    reader.close()
    assert reader.open == []
    return reader


@every_case
def test_tags_match_and_every_part_is_there(case: Case) -> None:
    reader = read(case)
    ids = [attributes["id"] for _, attributes in reader.tags if "id" in attributes]
    assert len(set(ids)) == len(ids)
    assert {ident for ident, *_ in SECTIONS} <= set(ids)


@every_case
def test_nothing_is_loaded_from_elsewhere(case: Case) -> None:
    html = page(case)
    assert not re.search(r"https?:|//\w+\.|@import|url\((?!#)|\bfetch\b|XMLHttpRequest", html)
    for tag, attributes in read(case).tags:
        assert "src" not in attributes
        assert tag not in ("link", "iframe", "img", "object", "embed")
        assert (attributes.get("href") or "#").startswith("#")
    assert "default-src 'none'" in re.sub("&#x27;", "'", html)


@every_case
def test_sentences_limits_causes_and_captions_are_in_the_text(case: Case) -> None:
    text = " ".join(read(case).text)
    assert headline(case) in text
    for said in (*case.sentences, *(it.text for it in case.limits), *(it.consequence for it in case.limits)):
        assert said in text
    for it in (*case.causes, *case.ranking):
        assert effect_name(it.effect).lower() in text.lower()
    for check in case.checks:
        assert check.about in text
    if case.formula is not None:
        assert case.formula.text in text
    if case.next_push is not None:
        assert case.next_push.text in text


@every_case
def test_every_drawing_says_in_words_what_it_shows_and_every_figure_has_a_caption(case: Case) -> None:
    tags = read(case).tags
    drawings = [attributes for tag, attributes in tags if tag == "svg"]
    assert all(attributes["role"] == "img" and len(attributes["aria-label"] or "") > 10 for attributes in drawings)
    count = [tag for tag, _ in tags].count
    assert count("figure") == count("figcaption")
    assert count("svg") == count("desc")


@every_case
def test_no_drawing_holds_a_number_that_is_none(case: Case) -> None:
    values = [value for tag, attributes in read(case).tags for value in attributes.values() if tag != "meta" and value]
    assert not [value for value in values if re.search(r"\b(nan|inf)\b", value)]


@every_case
def test_a_page_stays_small(case: Case) -> None:
    assert len(page(case).encode()) < BYTES_BOUND


def test_a_page_of_many_pushes_and_particles_stays_small() -> None:
    rng = np.random.default_rng(0)
    count = 200 * 60
    arrows = ResidualField(
        places=rng.uniform([0.3, -0.3], [0.8, 0.3], (count, 2)).astype(np.float32),
        displacements=rng.normal(0, 0.004, (count, 2)).astype(np.float32),
        push=np.repeat(np.arange(200), 60).astype(np.float32),
        along=rng.uniform(-1, 1, count).astype(np.float32),
    )
    clouds = ("before", "observed", "nominal", "extended")
    dense = [
        replace(it, **{name: np.repeat(getattr(it, name), 10, axis=0) for name in clouds}) for it in named().examples
    ]
    assert len(page(replace(named(), arrows=arrows, examples=tuple(dense * 3))).encode()) < BYTES_BOUND


def test_no_word_of_a_case_becomes_markup() -> None:
    hostile = "<script>alert(1)</script> & \"q\" 'q' <b>"
    cause = blame("table_tilt", "physics", hostile, 0.9, 3.0, estimate("tilt_x", 1.0, 0.2, "deg", about=hostile))
    push = a_set().next_push
    assert push is not None
    case = replace(
        a_set(),
        sentences=(hostile,),
        limits=(Limit(text=hostile, consequence=hostile, fatal=True),),
        causes=(cause,),
        ranking=(cause,),
        checks=tuple(replace(check, name=hostile, about=hostile) for check in named().checks),
        frames=tuple(replace(it, frame=hostile, about=hostile) for it in named().frames),
        next_push=replace(push, text=hostile, between=(hostile, hostile)),
        confused=(hostile,),
        confusions=np.ones((1, 1)),
        spent_s=((hostile, 1.0),),
    )
    html = page(case)
    assert hostile not in html
    assert escape(hostile) in html
    assert html.count("<script>") == 1
    assert hostile in " ".join(read(case).text)


@pytest.mark.parametrize(
    "change",
    [
        {"steps": np.full((3, 2), np.nan)},
        {"per_episode": np.full((2, 2), np.nan)},
        {"examples": named().examples[:1]},
        {"powers": ()},
        {"spent_s": ()},
        {"ranking": (), "causes": ()},
        {"confusions": np.full((7, 7), np.nan)},
        {"nominal": ()},
        {"arrows": replace(named().arrows, displacements=np.zeros_like(named().arrows.displacements))},
    ],
    ids=lambda change: next(iter(change)),
)
def test_what_was_not_measured_leaves_the_rest_as_it_is(change: dict[str, Any]) -> None:
    read(replace(named(), **change))


def test_a_report_is_written_where_it_should_be(tmp_path: Path) -> None:
    write_report(tmp_path / "report.html", none())
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == page(none())


def test_a_place_that_cannot_be_written_is_said_with_the_next_step(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="choose another place"):
        write_report(tmp_path / "missing" / "report.html", none())


@every_case
def test_what_to_do_next_is_said_at_the_top_of_the_page(case: Case) -> None:
    reader = read(case)
    text = " ".join("".join(reader.text).split())
    assert advice(case)
    for said in advice(case):
        assert said in text
        assert text.index(said) < text.index(SECTIONS[0][1])


def test_no_model_is_recommended_where_nothing_can_be_named_or_several_causes_are_left() -> None:
    assert not any("--model" in said for case in (none(), a_set()) for said in advice(case))
    assert any("--model" in said for said in advice(named()))


def test_the_command_that_plans_names_the_model_beside_the_report(tmp_path: Path) -> None:
    write_report(tmp_path / "report.html", named())
    assert f"--model {tmp_path / 'model.toml'}" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_what_is_mostly_unseen_is_said_and_so_are_weak_pairs_that_are_taken_for_one_another() -> None:
    weak = np.array([[0.02, 0.08, 0.0], [0.01, 0.14, 0.0], [0.0, 0.0, 0.9]])
    text = page(replace(named(), confused=("table_tilt", "draught", "stribeck"), confusions=weak))
    assert "Mostly unseen at that size: table tilt, draught." in text
    assert "Hard to tell apart: draught and table tilt" in text or "Hard to tell apart: table tilt and draught" in text
    clear = page(replace(named(), confused=("table_tilt", "draught"), confusions=np.diag([0.9, 0.9])))
    assert "No two of them are often taken for one another." in clear
    assert "Mostly unseen" not in clear


@pytest.mark.parametrize(("apart_mm", "said"), [(9.0, "tells them apart"), (1.2, "about 19 such pushes")])
def test_a_next_push_says_whether_one_is_enough(apart_mm: float, said: str) -> None:
    case = a_set()
    assert case.next_push is not None
    push = replace(case.next_push, apart_mm=apart_mm)
    assert said in page(replace(case, next_push=push, gain=replace(case.gain, nominal_mm=2.6)))


def test_where_no_model_was_extended_none_is_drawn() -> None:
    same = replace(named(), gain=replace(named().gain, extended_mm=named().gain.nominal_mm))
    assert "mm with the extended one" in page(named())
    assert "mm with the extended one" not in page(same)
    assert "The extended model is better in" not in page(same)


@pytest.mark.parametrize(
    ("probability", "said"), [(0.4, "nothing"), (0.7, "Perhaps something is missing"), (0.95, "cannot tell what")]
)
def test_a_verdict_that_names_nothing_says_how_sure_it_is_that_something_is_missing(
    probability: float, said: str
) -> None:
    unsure = replace(
        none(), limits=(), leftover=0.0, ranking=(blame("draught", "physics", "A draught.", probability, 1.0),)
    )
    assert said in headline(unsure)
    assert said in page(unsure)


def test_where_nothing_was_looked_for_beyond_the_causes_no_probability_of_nothing_is_stated() -> None:
    sure, unsure = (
        replace(none(), limits=(), leftover=float("nan"), ranking=(blame("draught", "physics", "A draught.", it, 1.0),))
        for it in (0.1, 0.7)
    )
    assert chance(sure) is None
    assert chance(unsure) == ("70 %", "that something is missing")


def test_a_model_that_was_not_extended_has_gained_nothing_and_nothing_is_said_of_a_share() -> None:
    gain = replace(named().gain, extended_mm=named().gain.nominal_mm, gain=0.0)
    assert "No extended model" in gain_sentence(gain)
    assert "0 %" not in gain_sentence(gain)


def test_a_liquid_is_shown_from_the_side_in_hundredths_of_it_and_not_over_the_table() -> None:
    reader = read(replace(named(), kind="liquid", steps=named().steps[:1]))
    ids, text = {attributes.get("id") for _, attributes in reader.tags}, " ".join(reader.text)
    assert not ids & {"field", "frames"}
    assert {"causes", "examples", "gains", "next"} <= ids
    assert "The next pour" in text
    assert "% of the liquid" in text
    assert "height [m]" in text
    assert "y [m]" not in text
    assert "pushes are predicted one after another" not in text


def test_of_a_cloth_the_next_motion_is_a_carry() -> None:
    reader = read(replace(named(), kind="cloth", next_push=None))
    ids, text = {attributes.get("id") for _, attributes in reader.tags}, " ".join(reader.text)
    assert {"field", "frames", "examples", "next"} <= ids
    assert "Which carry would tell most?" in text
    assert "No carry is proposed" in text
