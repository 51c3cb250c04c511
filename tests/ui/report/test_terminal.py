"""The verdict fits a terminal of 80 columns, and what a case says is never markup."""

import io
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from app.discovery.dataset.names import effect_name
from app.discovery.results.case import Case
from app.report import show_case
from app.report.sections.verdict import headline
from tests.ui.report.cases import CASES, a_set, named

every_case = pytest.mark.parametrize("case", [make() for make in CASES.values()], ids=list(CASES))


def printed(case: Case, report: Path | None = None, width: int = 80) -> list[str]:
    output = io.StringIO()
    Console(file=output, width=width).print(show_case(case, report))
    return output.getvalue().splitlines()


def flowing(lines: list[str]) -> str:
    return " ".join(" ".join(lines).replace("│", " ").split())


@every_case
@pytest.mark.parametrize("width", [80, 200])
def test_no_line_is_longer_than_80_characters(case: Case, width: int) -> None:
    assert max(len(line.rstrip()) for line in printed(case, Path("report.html"), width)) <= 80


@every_case
def test_verdict_sentences_limits_and_causes_are_shown(case: Case) -> None:
    text = flowing(printed(case))
    assert headline(case) in text
    assert all(sentence in text for sentence in case.sentences)
    assert all(it.text in text and it.consequence in text for it in case.limits)
    assert all(effect_name(it.effect).lower() in text.lower() for it in case.causes)


def test_the_next_push_and_the_report_s_place_are_shown() -> None:
    case = a_set()
    assert case.next_push is not None
    text = flowing(printed(case, Path("out/report.html")))
    assert case.next_push.text in text
    assert "out/report.html" in text


def test_a_long_path_stays_in_one_piece() -> None:
    path = Path("a" * 60) / "report.html"
    assert any(str(path) in line for line in printed(named(), path, width=120))


def test_brackets_are_not_markup() -> None:
    said = "left [/] of [red]it[/red] :warning:"
    assert said in flowing(printed(replace(named(), sentences=(said,))))
