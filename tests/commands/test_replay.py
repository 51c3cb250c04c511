"""`dipac replay` says in words what broke, and refuses what it cannot replay."""

from pathlib import Path

import numpy as np
import pytest

from app.__main__ import main
from app.core.errors import RecordingError, UsageError
from app.sim.autopsy import dissect, single
from app.sim.dump import Dump, save_dump
from tests.sim.broken import SETUP, flung, problem


def replayed(path: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    code = main(["replay", str(path)])
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


def test_a_recording_is_refused_in_plain_words(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    code, _, said = replayed(tmp_path / "episode.mcap", capsys)
    assert code == UsageError.exit_code
    assert "is a recording of an episode; replay takes dumps of simulations (.npz)" in said


def test_a_file_that_is_not_there_or_no_dump_ends_with_its_own_code(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert replayed(tmp_path / "none.npz", capsys)[0] == UsageError.exit_code
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    code, _, said = replayed(tmp_path / "other.npz", capsys)
    assert code == RecordingError.exit_code
    assert "is not a dump of a simulation" in said
