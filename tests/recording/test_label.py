"""Labels of a recording: a label becomes part of the file, and nothing else in it changes."""

import signal
import struct
import subprocess
import sys
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.stream_reader import CRCValidationError, StreamReader

from app.core.errors import RecordingError, UsageError
from app.recording.library.label import Label, labels, relabel
from app.recording.library.recover import recover
from app.recording.read.reader import read_messages
from app.recording.write import append
from app.recording.write.append import append_metadata
from tests.recording.demonstrations import demonstration
from tests.recording.samples import same

GOOD = Label.now("success", note='the rope lies "well" \N{GREEK SMALL LETTER MU}', operator="me")
BAD = Label.now("failure", note="", operator="you")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return demonstration(tmp_path)


def test_the_last_label_counts_and_the_earlier_ones_stay(path: Path) -> None:
    assert labels(path) == []
    relabel(path, GOOD)
    relabel(path, BAD)
    assert labels(path) == [GOOD, BAD]


def test_every_message_stays_as_it_was(path: Path) -> None:
    before, data = list(read_messages(path)), path.read_bytes()
    relabel(path, GOOD)
    after = list(read_messages(path))
    assert len(after) == len(before)
    assert all(same(a, b) for a, b in zip(before, after, strict=True))
    at = data_end(path)
    assert path.read_bytes()[: at - len(record_of(path))] == data[: at - len(record_of(path))]


def record_of(path: Path) -> bytes:
    """The label's record as it stands in the file."""
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        assert summary is not None
        index = summary.metadata_indexes[-1]
        stream.seek(index.offset)
        return stream.read(index.length)


def data_end(path: Path) -> int:
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    index = summary.metadata_indexes[-1]
    return index.offset + index.length


def test_the_file_is_whole_for_readers_that_are_not_ours(path: Path) -> None:
    relabel(path, GOOD)
    relabel(path, BAD)
    with path.open("rb") as stream:
        list(StreamReader(stream, validate_crcs=True).records)
        stream.seek(0)
        reader = make_reader(stream, validate_crcs=True)
        summary, records = reader.get_summary(), list(reader.iter_metadata())
        counted = sum(1 for _ in reader.iter_messages())
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.metadata_count == len(records) == len(summary.metadata_indexes) == 3
    assert counted == summary.statistics.message_count
    assert [record.metadata.get("said") for record in records] == [None, "success", "failure"]
    assert recover(path).was_whole


def test_the_checksum_of_the_summary_is_right(path: Path) -> None:
    relabel(path, GOOD)
    data = path.read_bytes()
    _, _, start, _, crc = struct.unpack("<BQQQI", data[-8 - 29 : -8])
    # All from the summary on up to the checksum itself: https://mcap.dev/spec, "Footer".
    assert zlib.crc32(data[start : -8 - 4]) == crc


def test_a_label_that_is_not_known_is_refused(path: Path) -> None:
    append_metadata(path, "dipac.label", {"said": "splendid"})
    with pytest.raises(RecordingError, match=r"'splendid'; known are success, failure, unlabelled"):
        labels(path)


def test_what_cannot_be_labelled_says_why(path: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="Unknown recording"):
        relabel(tmp_path / "none.mcap", GOOD)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(RecordingError, match="cut off"):
        relabel(cut, GOOD)


def test_a_disk_without_room_leaves_the_old_file(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = path.read_bytes()

    def refuse(*_: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(append.os, "sendfile", refuse)
    with pytest.raises(RecordingError, match="No space left on device"):
        relabel(path, GOOD)
    assert path.read_bytes() == data
    assert [file.name for file in path.parent.iterdir() if file.name.endswith(".new")] == []


def test_labels_that_are_given_at_once_are_all_there(path: Path) -> None:
    notes = [str(number) for number in range(8)]
    with ThreadPoolExecutor() as together:
        list(together.map(lambda note: relabel(path, Label.now("success", note=note, operator="")), notes))
    assert sorted(label.note for label in labels(path)) == notes


def test_the_checksum_of_the_data_goes_on_to_cover_all_of_it(path: Path) -> None:
    relabel(path, GOOD)
    data = bytearray(path.read_bytes())
    at = data.find(b"success")
    data[at] ^= 1
    path.write_bytes(data)
    with path.open("rb") as stream, pytest.raises(CRCValidationError):
        list(StreamReader(stream, validate_crcs=True).records)


def test_a_link_stays_a_link_and_what_it_leads_to_is_labelled(path: Path, tmp_path: Path) -> None:
    link = tmp_path / "link.mcap"
    link.symlink_to(path)
    relabel(link, GOOD)
    assert link.is_symlink()
    assert labels(path) == [GOOD]


def test_what_is_recovered_again_keeps_its_labels(path: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:-60])
    made = recover(cut).path
    relabel(made, GOOD)
    assert recover(cut).path == made
    assert labels(made) == [GOOD]
    assert recover(made).was_whole


_WRITES = """
import sys, time
from pathlib import Path
from app.core.messages import Episode
from app.recording.write.file import EpisodeFile
from tests.recording.samples import Maker
file = EpisodeFile(Path(sys.argv[1]), Maker(seed=0)(Episode))
print("open", flush=True)
time.sleep(60)
"""


@pytest.mark.serial
def test_a_recording_that_is_being_written_is_left_alone_until_its_writer_is_gone(tmp_path: Path) -> None:
    path = tmp_path / "now.mcap"
    with subprocess.Popen([sys.executable, "-c", _WRITES, path], stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        assert writer.stdout.readline() == "open\n"
        with pytest.raises(RecordingError, match="is being written"):
            recover(path)
        with pytest.raises(RecordingError, match="is being written"):
            append_metadata(path, "dipac.label", GOOD.written())
        writer.send_signal(signal.SIGKILL)
    with pytest.raises(RecordingError, match="nothing to recover"):
        recover(path)
