"""Whatever befell a file, what is intact comes out of it."""

import itertools
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, DataEnd
from mcap.records import Message as Written
from mcap.stream_reader import StreamReader, breakup_chunk

from app.commands.recover import recover as recover_command
from app.core.errors import RecordingError, UsageError
from app.recording.library.recover import recover
from app.recording.read.reader import read_messages
from tests.recording.samples import Recording, same_as_read

_each = settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
_fractions = st.floats(0, 1, exclude_max=True)
_numbers = itertools.count()


class Chunks:
    """Ends of the chunks of a whole file, each with the number of our messages up to it."""

    def __init__(self, path: Path) -> None:
        self.ends: list[tuple[int, int]] = []
        ours, count = set[int](), 0
        with path.open("rb") as stream:
            for record in StreamReader(stream, emit_chunks=True).records:
                if isinstance(record, DataEnd):
                    break
                if isinstance(record, Chunk):
                    for inner in breakup_chunk(record):
                        if isinstance(inner, Channel) and inner.topic.startswith("/dipac/"):
                            ours.add(inner.id)
                        count += isinstance(inner, Written) and inner.channel_id in ours
                    self.ends.append((stream.tell(), count))

    def messages_before(self, at: int) -> int:
        return max((count for end, count in self.ends if end <= at), default=0)


@pytest.fixture(scope="module")
def chunks(recording: Recording) -> Chunks:
    found = Chunks(recording.path)
    assert len(found.ends) >= 4
    return found


def damaged_copy(folder: Path, data: bytes) -> Path:
    path = folder / f"damaged{next(_numbers)}.mcap"
    path.write_bytes(data)
    return path


@_each
@given(fraction=_fractions)
def test_all_before_a_cut_is_recovered(fraction: float, recording: Recording, chunks: Chunks, tmp_path: Path) -> None:
    whole, written = recording.path, recording.messages
    data = whole.read_bytes()
    at = int(fraction * len(data))
    path = damaged_copy(tmp_path, data[:at])
    try:
        recovered = recover(path)
    except RecordingError:
        assert at < chunks.ends[0][0]
        return
    read = list(read_messages(recovered.path))
    assert all(same_as_read(a, b) for a, b in zip(written, read, strict=False))
    assert len(read) >= chunks.messages_before(at)
    assert 0 <= recovered.lost_bytes < 3_000_000
    assert path.read_bytes() == data[:at]


@_each
@given(fraction=_fractions, flip=st.integers(1, 255), length=st.integers(1, 200))
def test_all_but_a_damaged_spot_is_recovered(
    fraction: float, flip: int, length: int, recording: Recording, chunks: Chunks, tmp_path: Path
) -> None:
    whole, written = recording.path, recording.messages
    data = bytearray(whole.read_bytes())
    body = chunks.ends[0][0]
    at = body + int(fraction * (len(data) - body))
    for index in range(at, min(at + length, len(data))):
        data[index] ^= flip
    recovered = recover(damaged_copy(tmp_path, bytes(data)))
    by_id = {message.id: message for message in written}
    read = list(read_messages(recovered.path))
    assert all(same_as_read(by_id[message.id], message) for message in read)
    assert len(read) >= chunks.messages_before(at)


def test_a_damaged_chunk_does_not_cost_those_after_it(recording: Recording, chunks: Chunks, tmp_path: Path) -> None:
    whole, written = recording.path, recording.messages
    data = bytearray(whole.read_bytes())
    data[chunks.ends[0][0] + 500_000] ^= 0xFF
    recovered = recover(damaged_copy(tmp_path, bytes(data)))
    read = list(read_messages(recovered.path))
    assert recovered.lost_bytes > 0
    assert written[0].id == read[0].id
    assert written[-1].id == read[-1].id
    assert 0 < len(written) - len(read) < len(written) / 2


def test_a_recovered_file_is_indexed_and_another_reader_reads_it(recording: Recording, tmp_path: Path) -> None:
    data = recording.path.read_bytes()
    recovered = recover(damaged_copy(tmp_path, data[: len(data) // 2]))
    with recovered.path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == recovered.messages == len(list(reader.iter_messages()))
        assert summary.chunk_indexes
        assert [record.name for record in reader.iter_metadata()] == ["dipac"]


def test_a_whole_file_is_left_alone(recording: Recording) -> None:
    path = recording.path
    recovered = recover(path)
    assert recovered.was_whole
    assert recovered.path == path
    assert [file.name for file in path.parent.glob("*.mcap")] == [path.name]


def test_a_file_without_its_index_is_given_one(recording: Recording, tmp_path: Path) -> None:
    path, written = recording.path, recording.messages
    recovered = recover(damaged_copy(tmp_path, path.read_bytes()[:-300]))
    assert recovered.lost_bytes == 0
    assert not recovered.was_whole
    assert len(list(read_messages(recovered.path))) == len(written)


@pytest.mark.parametrize("content", [b"", b"not a recording", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n" * 3])
def test_where_nothing_can_be_recovered_that_is_said_and_nothing_is_left(content: bytes, tmp_path: Path) -> None:
    path = damaged_copy(tmp_path, content)
    with pytest.raises(RecordingError, match="nothing to recover"):
        recover(path)
    assert list(tmp_path.iterdir()) == [path]


def test_where_the_new_file_cannot_be_written_that_is_said_and_nothing_is_left(
    recording: Recording, tmp_path: Path
) -> None:
    path = damaged_copy(tmp_path, recording.path.read_bytes()[:-300])
    path.with_name(f"{path.stem}.recovered.mcap").mkdir()
    with pytest.raises(RecordingError, match="Cannot recover"):
        recover(path)
    assert not list(tmp_path.glob("*.draft"))


def test_the_command_recovers_each_file_and_says_what_came_of_it(
    recording: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = recording.path
    cut = damaged_copy(tmp_path, whole.read_bytes()[:3_000_000])
    recover_command(files=(whole, cut))
    first, second = capsys.readouterr().out.strip().splitlines()
    assert "is whole" in first
    assert str(cut.with_name(f"{cut.stem}.recovered.mcap")) in second
    assert "bytes" in second


def test_the_command_names_the_recordings_that_there_are(recording: Recording) -> None:
    path = recording.path
    with pytest.raises(UsageError, match=path.name):
        recover_command(files=(path.with_name("other.mcap"),))
    with pytest.raises(UsageError, match="dipac recover FILE"):
        recover_command(files=())
