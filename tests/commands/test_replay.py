"""`dipac replay` shows recordings, says in words what broke a simulation, and refuses what it cannot replay."""

from pathlib import Path

import numpy as np
import pytest

from app.__main__ import main
from app.core.errors import ParameterError, RecordingError, UsageError
from app.jobs.worker_api import nominal_model
from app.recording.exchange.model_file import save_model
from app.sim.diagnosis.dump import Dump, save_dump
from app.sim.diagnosis.failure_diagnosis import dissect, single
from app.sim.diagnosis.rod_failure_diagnosis import dissect_rod
from tests.sim.broken import SETUP, flung, problem
from tests.sim.broken_rods import too_stiff
from tests.ui.film import film


def replayed(path: Path, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, str, str]:
    code = main(["replay", str(path), *options])
    said = capsys.readouterr()
    return code, said.out, said.err


def test_a_dump_is_replayed_to_the_verdict_of_its_autopsy(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path, case = tmp_path / "case.npz", flung()
    save_dump(path, Dump(case=case, about="a rope, candidate 1 of 2"))
    code, said, _ = replayed(path, capsys)
    found = dissect(case)
    assert code == 0
    assert said.startswith("a rope, candidate 1 of 2: 60 particles (elastic), 40 substeps of 0.0005 s, tools: finger,")
    assert found.verdict() in said
    rows = [line.split("│")[1:-1] for line in said.splitlines() if line.startswith("│")]
    assert [int(row[0]) for row in rows][-8:] == list(range(found.until - 7, found.until + 1))
    assert float(rows[-1][1]) == pytest.approx(found.trace.speed_m_s[-1], rel=1e-3)
    assert int(rows[-1][4]) == found.trace.outside[-1]


def test_a_dump_of_a_rod_is_replayed_by_the_same_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path, case = tmp_path / "case.npz", too_stiff()
    save_dump(path, Dump(case=case, about="a rope, candidate 1 of 2"))
    code, said, _ = replayed(path, capsys)
    found = dissect_rod(case)
    assert code == 0
    assert said.startswith("a rope, candidate 1 of 2: a rod of 41 nodes (0.4 m, radius 0.008 m), 200 steps of 0.001 s")
    assert found.verdict() in said
    rows = [line.split("│")[1:-1] for line in said.splitlines() if line.startswith("│")]
    assert [int(row[0]) for row in rows][-8:] == list(range(max(0, found.until - 7), found.until + 1))
    assert float(rows[-1][1]) == pytest.approx(found.trace.speed_m_s[-1], rel=1e-3)
    assert float(rows[-1][2]) == pytest.approx(100 * found.trace.stretch[-1], rel=1e-2)


def test_what_was_wrong_with_the_input_is_said_without_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    phi, state, tool, setting = problem()
    phi[0, 0] = np.nan
    save_dump(
        tmp_path / "a.npz", Dump(case=single(SETUP, phi, state, tool, setting), about="a", versions={"dipac": "0"})
    )
    code, said, _ = replayed(tmp_path / "a.npz", capsys)
    assert code == 0
    assert "Written by dipac 0. These are not the versions here" in said
    assert "The input is wrong: phi is nan for candidate 0, component stiffness" in said
    assert "max speed" not in said


def test_options_for_recordings_are_refused_for_dumps(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    code, _, said = replayed(tmp_path / "case.npz", capsys, "--at", "3")
    assert code == UsageError.exit_code
    assert "the options of replay are for recordings alone" in said


def test_recordings_that_cannot_be_replayed_name_the_next_step(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    code, _, said = replayed(tmp_path / "none.mcap", capsys, "--replan")
    assert code == UsageError.exit_code
    assert "Unknown recording" in said
    path = film(tmp_path)
    path.write_bytes(path.read_bytes()[:-1])
    code, _, said = replayed(path, capsys, "--replan")
    assert code == RecordingError.exit_code
    assert f"`dipac recover {path}`" in said


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (("--at", "-1"), "--at = -1 must not be negative"),
        (("--speed", "0"), "--speed = 0 must be above 0"),
        (("--replan", "--at", "99"), "is after the end of"),
        (("--replan",), "no object and no goal had been seen"),
        (("--replan", "--at", "5", "--model", "none.toml"), "Cannot read the model none.toml"),
    ],
)
def test_what_cannot_be_replayed_or_planned_is_said(
    options: tuple[str, ...], why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    code, _, said = replayed(film(tmp_path), capsys, *options)
    assert code in (UsageError.exit_code, ParameterError.exit_code)
    assert why in " ".join(said.split())


@pytest.mark.slow
def test_a_moment_is_planned_again_in_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    save_model(tmp_path / "model.toml", nominal_model("rope_push"))
    options = ("--at", "5", "--replan", "--model", str(tmp_path / "model.toml"))
    code, said, complaint = replayed(film(tmp_path), capsys, *options)
    assert code == 0, complaint
    assert "planned again" in said
    assert "mm apart" in said


def test_a_file_that_is_not_there_or_no_dump_ends_with_its_own_code(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert replayed(tmp_path / "none.npz", capsys)[0] == UsageError.exit_code
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    code, _, said = replayed(tmp_path / "other.npz", capsys)
    assert code == RecordingError.exit_code
    assert "is not a dump of a simulation" in said
