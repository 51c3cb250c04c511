"""A check finds every way in which a recording is not what it says, and nothing where it is."""

import subprocess
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.core.messages import Episode, Goal, Notice
from app.recording.format import digests
from app.recording.library.checks import check
from app.recording.write.file import EpisodeFile
from tests.recording.demonstrations import demonstration
from tests.recording.samples import Maker, record


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return demonstration(tmp_path_factory.mktemp("whole"))


def test_nothing_is_wrong_with_a_whole_one(whole: Path) -> None:
    assert check(whole) == []


@pytest.mark.serial
def test_the_standard_tool_reads_our_checksums(whole: Path) -> None:
    told = subprocess.run(
        ["sha256sum", "--check", "--strict", digests.SUMS], cwd=whole.parent, capture_output=True, text=True, check=True
    )
    assert told.stdout == f"{whole.name}: OK\n"


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.floats(0.0, 1.0, exclude_max=True), bit=st.integers(0, 7))
def test_one_wrong_bit_anywhere_is_found(whole: Path, tmp_path: Path, place: float, bit: int) -> None:
    data = bytearray(whole.read_bytes())
    data[int(place * len(data))] ^= 1 << bit
    path = tmp_path / whole.name
    path.write_bytes(data)
    (tmp_path / digests.SUMS).write_text(f"{digests.digest(whole)}  {whole.name}\n")
    assert any(finding.grave for finding in check(path))


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.floats(0.0, 1.0, exclude_max=True))
def test_one_that_was_cut_off_is_found(whole: Path, tmp_path: Path, place: float) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole.read_bytes()[: int(place * whole.stat().st_size)])
    assert [finding.grave for finding in check(path)] == [True]


def test_a_checksum_that_is_missing_is_told_and_no_damage(whole: Path, tmp_path: Path) -> None:
    path = tmp_path / "copy.mcap"
    path.write_bytes(whole.read_bytes())
    (finding,) = check(path)
    assert not finding.grave
    assert digests.SUMS in finding.text


def test_a_cause_that_is_not_there_and_an_id_that_is_there_twice_are_told(tmp_path: Path) -> None:
    make = Maker(seed=0)
    first = make(Notice, cause=())
    lost, again = make(Notice, cause=(make(Goal).id,)), make(Notice, cause=(), id=first.id)
    findings = check(record(tmp_path, make(Episode, cause=()), [first, lost, again]))
    assert {finding.text.split(":")[0]: finding.grave for finding in findings} == {
        "messages that name a cause that is not in the recording before them": False,
        "messages that have an id that another has": True,
    }


def test_one_that_is_being_written_is_told_and_no_damage(tmp_path: Path) -> None:
    writing = EpisodeFile(tmp_path / "now.mcap", Maker(seed=0)(Episode))
    try:
        (finding,) = check(tmp_path / "now.mcap")
        assert not finding.grave
        assert "being written" in finding.text
    finally:
        writing.close()
