"""`dipac bench`: what it lists, and options that are a bench's own."""

from pathlib import Path

import pytest

from app.__main__ import main
from app.core.errors import UsageError


def test_options_after_a_benchs_name_are_its_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "discovery", "--into", str(tmp_path / "none.jsonl"), "--n", "0"]) == 0
    said = capsys.readouterr().out
    assert "The hidden-effect suite" in said
    assert "Targets" in said


def test_what_benches_there_are_is_listed_without_running_any(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--list-only"]) == 0
    said = capsys.readouterr().out
    assert "discovery:" in said
    assert "Targets" not in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["sim", "--n", "3"], "--n is no option of `dipac bench`; a single bench has options: cell, discovery"),
        (["--n", "3"], "--n is no option"),
        (["discovery", "plan", "--n", "3"], "--n is no option"),
        (["plan", "--json", "rows.json"], "--json takes one bench that makes rows; those are: sim"),
        (["nix"], "nix"),
    ],
)
def test_a_wrong_order_says_what_there_is(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", *words]) == UsageError.exit_code
    assert said in " ".join(capsys.readouterr().err.split())
