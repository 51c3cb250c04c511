"""The bench of the cell counts a seed that failed and goes on."""

import json
from pathlib import Path

import pytest

from bench import cell

FAILED = {"failure": "the arm is gone", "chamfer_m2": [], "decision_s": [], "first_push_s": None}


@pytest.mark.parametrize(
    ("kept", "why"),
    [
        (json.dumps(FAILED), "the arm is gone"),
        (json.dumps(FAILED | {"failure": None}), "no push was finished"),
        ("{", "Expecting"),
    ],
)
def test_a_failed_seed_is_a_row_that_says_why(kept: str, why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "seed4.json").write_text(kept)
    row = cell._episode(4, 10, tmp_path)
    assert why in row["failure"]
    cell._print([row])
    said = capsys.readouterr().out
    assert f"seed 4 failed: {why}" in said
    assert "1 of 1 seeds failed" in said
