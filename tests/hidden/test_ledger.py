"""Results survive a cut, and those of several machines are read as one."""

import json
from pathlib import Path

import numpy as np
import pytest

from app.core.errors import UsageError
from app.evaluation.results_log import append
from bench import discovery
from bench.hidden import ledger
from bench.hidden.baselines import TITLES
from bench.hidden.draws import drawn
from tests.hidden.synthetic import SEED, good, line


def lines(count: int) -> list[dict]:
    rng = np.random.default_rng(SEED)
    cases = [drawn(SEED, number, "own") for number in range(count)]
    return [line(case, good(case, rng)) for case in cases]


def test_a_line_that_was_cut_off_counts_for_nothing_and_harms_no_other(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    first, second, third = lines(3)
    append(path, first)
    with path.open("a") as file:
        file.write(json.dumps(second)[:40])
    append(path, third)
    assert ledger.read([path]) == [first, third]


def test_files_are_read_as_one_and_a_failure_gives_way_to_a_verdict(tmp_path: Path) -> None:
    one, other = tmp_path / "one.jsonl", tmp_path / "other.jsonl"
    first, second = lines(2)
    failed = {"case": first["case"], "failure": "TimeoutExpired"}
    append(one, failed)
    append(other, first)
    append(other, second)
    for paths in ([one, other], [other, one]):
        assert ledger.finished(ledger.read(paths)) == [first, second]
    assert ledger.read([one, tmp_path / "none.jsonl"]) == [failed]


def test_the_bench_scores_what_is_there_and_draws_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, report = tmp_path / "results.jsonl", tmp_path / "report"
    for each in lines(40):
        append(path, each | {"baselines": dict.fromkeys(TITLES, each["verdict"])})
    discovery.main(["--n", "0", "--into", str(path), "--report", str(report)])
    said = capsys.readouterr().out
    assert "Targets" in said
    assert "expected calibration error" in said
    names = {"confusion.svg", "reliability.svg", "power.svg"}
    assert {each.name for each in (report / "own").iterdir()} == names
    told = (report / "targets.md").read_text()
    assert "| physics: first is right, at >= 1x typical | >= 85% |" in told
    assert "## By family, own engine, other numerics" in told
    assert "| method | dipac discover | all parameters at once | BIC of single causes |" in told


def test_what_is_done_is_not_done_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "results.jsonl"
    for each in lines(5):
        append(path, each)
    before = path.read_text()
    discovery.main(["--n", "5", "--world", "own", "--seed", str(SEED), "--into", str(path)])
    assert path.read_text() == before


def test_a_line_of_other_dynamics_is_another_case(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rods = lines(1)[0]
    points = rods | {"case": rods["case"] | {"dynamics": "mpm"}}
    before = rods | {"case": {key: value for key, value in rods["case"].items() if key not in ("dynamics", "images")}}
    assert ledger.key_of(rods) != ledger.key_of(points) == ledger.key_of(before)
    append(tmp_path / "both.jsonl", rods)
    append(tmp_path / "both.jsonl", points)
    for dynamics in ("rods", "mpm"):
        discovery.main(["--into", str(tmp_path / "both.jsonl"), "--dynamics", dynamics])
        assert "(n = 1)" in capsys.readouterr().out


def test_without_images_there_are_no_material_points() -> None:
    with pytest.raises(UsageError, match="--light or --dynamics mpm"):
        discovery.main(["--light", "--dynamics", "mpm"])


def test_other_sizes_and_one_family_are_other_cases_and_old_lines_are_of_all() -> None:
    (of_all,) = lines(1)
    told = of_all["case"]
    wide = {**of_all, "case": {**told, "sizes": [1.0, 2.0]}}
    physics = {**of_all, "case": {**told, "family": "physics"}}
    old = {**of_all, "case": {name: value for name, value in told.items() if name not in ("sizes", "family", "task")}}
    keys = [ledger.key_of(each) for each in (of_all, wide, physics)]
    assert len(set(keys)) == 3
    assert ledger.key_of(old) == keys[0]
