"""The tables and figures of what learned policies are worth, of a few episodes."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from bench.learned import main

COUNTS = (2, 10)


def row(planner: str, seed: int, chamfer_mm2: float | None, ablation: str = "none") -> dict[str, Any]:
    """An episode of the rope that ends there; None where it has no end."""
    ended = None if chamfer_mm2 is None else 1e-6 * chamfer_mm2
    return {
        "key": f"rope_push {planner} {ablation} {seed}",
        "task": "rope_push",
        "planner": planner,
        "ablation": ablation,
        "seed": seed,
        "success": chamfer_mm2 is not None and chamfer_mm2 < 288.0,
        "failure": "" if ended else "lost",
        "reward": 1.0,
        "chamfer_m2": ended,
        "chamfers_m2": [8e-3, ended] if ended else [],
        "decisions_s": [0.5] if ended else [],
    }


def write(file: Path, rows: Iterable[dict[str, Any]]) -> None:
    file.write_text("".join(json.dumps(each) + "\n" for each in rows))


def test_methods_are_told_beside_the_planner_and_by_the_number_of_demonstrations(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(
        tmp_path / "evaluation.jsonl",
        [row("dipac", 0, 100.0), row("dipac", 1, 300.0), row("dipac", 10, 9.0), row("dipac", 0, 5.0, "no_calibration")],
    )
    write(tmp_path / "policies.jsonl", [row("bc", 0, 6000.0), row("dipac+bc", 0, 200.0), row("dipac+bc", 1, 400.0)])
    few = [row("dipac+bc", 0, 900.0), row("dipac+bc", 0, 250.0), row("bc", 0, None), row("bc", 1, 5000.0)]
    write(tmp_path / "efficiency.jsonl", [{**each, "demonstrations": 2} for each in few])
    main(tmp_path, tmp_path)
    told = [[cell.strip() for cell in line.strip("|").split("|")] for line in capsys.readouterr().out.splitlines()]
    ends = {cells[0]: (cells[1], cells[4]) for cells in told if len(cells) == 9}
    assert ends["dipac"] == ("2", "200")
    assert ends["dipac+bc"] == ("2", "300")
    assert "dipac, no calibration" not in ends
    counted = {cells[0]: cells[1:] for cells in told if len(cells) == 1 + len(COUNTS)}
    assert counted["method"] == [str(count) for count in COUNTS]
    assert counted["bc"] == ["0%, 5000", "0%, 6000"]
    assert counted["dipac+bc"] == ["100%, 250", "50%, 300"]
    for name in ("learned", "demonstrations"):
        assert "dipac+bc" in (tmp_path / f"rope_push-{name}.svg").read_text()
