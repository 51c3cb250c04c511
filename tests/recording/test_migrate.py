"""Migration: recordings of an older version are read as if this one had written them, and can be rewritten so."""

import json
from pathlib import Path

import pytest
from mcap.reader import make_reader

from app.__main__ import main
from app.core.errors import RecordingError
from app.core.messages import Episode, Health, Notice
from app.recording.format import digests
from app.recording.format.channels import KINDS, SCHEMA_VERSION
from app.recording.format.migrate import STEPS, changed_since, migrate_message
from app.recording.library.checks import check
from app.recording.library.label import Label, labels, relabel
from app.recording.library.recording_index import entry
from app.recording.library.renew import renew
from app.recording.read.reader import read_messages
from tests.recording.samples import Maker, Recording, record, same
from tests.recording.test_foxglove import lines, metadata, obeys
from tests.recording.versions import as_version_1


@pytest.fixture
def new(make: Maker, tmp_path: Path) -> Path:
    said = [make(kind, cause=()) for _ in range(3) for kind in (Notice, Health)]
    return record(tmp_path / "new", make(Episode, cause=()), said)


@pytest.fixture
def old(new: Path, tmp_path: Path) -> Path:
    path = as_version_1(new, tmp_path / "old" / new.name)
    digests.note(path)
    return path


def test_each_version_has_its_step_and_each_step_its_channels() -> None:
    assert len(STEPS) == SCHEMA_VERSION - 1
    assert changed_since(SCHEMA_VERSION) == frozenset()
    assert changed_since(1) <= set(KINDS)


def test_the_program_of_version_1_was_in_a_mode_and_is_now_doing_something() -> None:
    assert migrate_message({"id": "a", "mode": "planning"}, "/dipac/health", 1) == {"id": "a", "doing": "planning"}
    # Of other messages `mode` is what it was, and of this version nothing is changed.
    assert migrate_message({"mode": "idle"}, "/dipac/arm_state", 1) == {"mode": "idle"}
    assert migrate_message({"mode": "idle"}, "/dipac/health", SCHEMA_VERSION) == {"mode": "idle"}


def test_an_old_file_is_read_as_if_it_were_new(new: Path, old: Path) -> None:
    assert b'"mode"' in next(data for data in said_on(old, "/dipac/health"))
    written, read = list(read_messages(new)), list(read_messages(old))
    assert len(written) == len(read) == 7
    assert all(same(a, b) for a, b in zip(written, read, strict=True))


def test_every_kind_of_message_is_read_from_an_old_file(recording: Recording, tmp_path: Path) -> None:
    path = as_version_1(recording.path, tmp_path / "old.mcap")
    assert [m.id for m in read_messages(path)] == [m.id for m in recording.messages]
    assert not any(finding.grave for finding in check(path) if "cause" not in finding.text)


def test_a_rewritten_file_holds_the_same_in_the_newest_version(new: Path, old: Path) -> None:
    before = list(read_messages(old))
    times = [(message.log_time, message.sequence) for _, _, message in lines(old)]
    assert renew(old)
    assert metadata(old) == metadata(new)
    assert all(same(a, b) for a, b in zip(before, read_messages(old), strict=True))
    assert [(message.log_time, message.sequence) for _, _, message in lines(old)] == times
    assert list(map(json.loads, said_on(old, "/dipac/health"))) == list(map(json.loads, said_on(new, "/dipac/health")))
    assert check(old) == []
    assert [file.name for file in old.parent.iterdir() if file.name.endswith(".new")] == []


def test_what_was_rewritten_obeys_its_schema(old: Path) -> None:
    renew(old)
    for schema, channel, message in lines(old):
        if channel.topic == "/dipac/health":
            described = json.loads(schema.data)
            assert "doing" in described["required"]
            obeys(json.loads(message.data), described)


def test_a_file_of_the_newest_version_is_not_touched(new: Path) -> None:
    data, changed_ns = new.read_bytes(), new.stat().st_mtime_ns
    assert not renew(new)
    assert (new.read_bytes(), new.stat().st_mtime_ns) == (data, changed_ns)


def test_labels_and_the_time_of_the_file_stay(old: Path) -> None:
    relabel(old, Label.now("failure", note="it slipped", operator="me"))
    relabel(old, Label.now("success", note="", operator="you"))
    before, changed_ns = labels(old), old.stat().st_mtime_ns
    renew(old)
    assert labels(old) == before
    assert old.stat().st_mtime_ns == changed_ns


def test_the_checksum_is_renewed_and_never_hides_that_it_was_wrong(old: Path, tmp_path: Path) -> None:
    changed = tmp_path / "changed" / old.name
    changed.parent.mkdir()
    changed.write_bytes(old.read_bytes())
    (changed.parent / digests.SUMS).write_text(f"{'0' * 64}  {changed.name}\n")
    for path in (old, changed):
        renew(path)
    assert digests.stored_digest(old) == digests.digest(old)
    assert digests.stored_digest(changed) == "0" * 64


def test_a_damaged_file_stays_as_it_is(old: Path) -> None:
    data = bytearray(old.read_bytes())
    data[len(data) // 4] ^= 1
    old.write_bytes(data)
    with pytest.raises(RecordingError, match="dipac recover"):
        renew(old)
    assert old.read_bytes() == data
    assert {file.name for file in old.parent.iterdir()} == {old.name, digests.SUMS}


def test_a_check_says_that_a_file_is_old_and_finds_no_fault_with_it(old: Path) -> None:
    (finding,) = check(old)
    assert not finding.grave
    assert f"`dipac recordings migrate {old}`" in finding.text
    assert entry(old).row()["schema_version"] == "1"


def test_the_command_says_what_it_does_and_only_says_it_when_asked_to(
    old: Path, new: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = old.read_bytes()
    for option, expected in (
        (["--dry-run"], "would be rewritten from version 1 to 2"),
        ([], "was rewritten from version"),
    ):
        assert old.read_bytes() == data
        assert main(["recordings", "migrate", str(old), str(new), *option]) == 0
        told = capsys.readouterr().out
        assert f"{old}: {expected}" in told
        assert "1 of 2 recordings are of version 2 already." in told
    assert main(["recordings", "migrate", str(old.parent), str(new)]) == 0
    assert "2 of 2 recordings are of version 2 already." in capsys.readouterr().out
    cut = old.with_name("cut.mcap")
    cut.write_bytes(data[:-50])
    assert main(["recordings", "migrate", str(cut), str(new)]) == RecordingError.exit_code
    assert "nothing was rewritten" in capsys.readouterr().err


def said_on(path: Path, topic: str) -> list[bytes]:
    with path.open("rb") as stream:
        return [message.data for _, _, message in make_reader(stream).iter_messages([topic])]
