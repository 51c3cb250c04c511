"""Recovery mends what a check finds: it leaves out what is damaged or there twice, and keeps everything else."""

import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import IndexType, Writer

from app.commands.recordings.show import show
from app.core.errors import RecordingError
from app.core.messages import Particles, Transition
from app.recording.format.channels import SURFACE_TOPIC, topic_of
from app.recording.library.checks import check
from app.recording.library.recover import recover
from app.recording.read.reader import read_messages
from tests.recording.demonstrations import PUSHES, demonstration

Edit = Callable[[str, int, bytes], bytes | None]
TRANSITIONS, PARTICLES = topic_of(Transition), topic_of(Particles)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return demonstration(tmp_path_factory.mktemp("whole"))


def rewritten(source: Path, goal: Path, edit: Edit = lambda _topic, _count, data: data, **how: object) -> Path:
    """Another program's copy: `edit` gets each message's topic, number there and data; None leaves it out."""
    counts, channels = dict[str, int](), dict[str, int]()
    again = bool(how.pop("again", False))
    with source.open("rb") as old, goal.open("wb") as new:
        reader, writer = make_reader(old), Writer(new, **how)
        writer.start()
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, record.metadata)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            topic = channel.topic
            if topic not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[topic] = writer.register_channel(topic, channel.message_encoding, number)
            counts[topic] = counts.get(topic, -1) + 1
            data = edit(topic, counts[topic], message.data)
            for _ in range(0 if data is None else 1 + again):
                writer.add_message(channels[topic], message.log_time, data, message.publish_time)
        writer.finish()
    return goal


def grave(path: Path) -> list[str]:
    return [finding.text for finding in check(path) if finding.grave]


@pytest.mark.parametrize("broken", [b'{"id": ', b"", b'{"id":null,"time_s":null}', b"\xff"], ids=repr)
def test_one_invalid_message_costs_that_message(broken: bytes, whole: Path, tmp_path: Path) -> None:
    spoilt = rewritten(
        whole, tmp_path / "a.mcap", lambda topic, count, data: broken if (topic, count) == (TRANSITIONS, 1) else data
    )
    assert "recover" in " ".join(grave(spoilt))
    recovered = recover(spoilt)
    assert recovered.left_out == {TRANSITIONS: 1}
    assert grave(recovered.path) == []
    kept = [message.id for message in read_messages(recovered.path)]
    lost = {message.id for message in read_messages(whole)} - set(kept)
    assert len(lost) == 1
    assert recover(recovered.path).was_whole


def test_a_message_without_its_cloud_is_left_out(whole: Path, tmp_path: Path) -> None:
    spoilt = rewritten(
        whole, tmp_path / "a.mcap", lambda topic, count, data: None if (topic, count) == (SURFACE_TOPIC, 0) else data
    )
    assert "recover" in " ".join(grave(spoilt))
    recovered = recover(spoilt)
    assert recovered.left_out == {PARTICLES: 1}
    assert grave(recovered.path) == []


def test_what_is_there_twice_counts_once_and_recovery_keeps_one(whole: Path, tmp_path: Path) -> None:
    doubled = rewritten(whole, tmp_path / "a.mcap", again=True)
    assert "recover" in " ".join(grave(doubled))
    assert len(list(read_messages(doubled, [Transition]))) == PUSHES
    recovered = recover(doubled)
    assert [each.id for each in read_messages(recovered.path)] == [each.id for each in read_messages(whole)]
    assert grave(recovered.path) == []


def starts_of(data: bytes) -> Iterator[tuple[int, int]]:
    """Opcode and offset of every record."""
    at = 8
    while at < len(data) - 8:
        yield data[at], at
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")


@pytest.mark.parametrize("length", [2**40, 2**60])
@pytest.mark.parametrize("which", [0, 1], ids=["first", "metadata"])
def test_a_record_of_an_absurd_length_costs_that_record(length: int, which: int, whole: Path, tmp_path: Path) -> None:
    data = bytearray(whole.read_bytes())
    at = [at for _, at in starts_of(data)][which]
    data[at + 1 : at + 9] = struct.pack("<Q", length)
    spoilt = tmp_path / "a.mcap"
    spoilt.write_bytes(data)
    assert "recover" in " ".join(grave(spoilt))
    recovered = recover(spoilt)
    assert len(list(read_messages(recovered.path))) == len(list(read_messages(whole)))
    assert grave(recovered.path) == []


@pytest.mark.parametrize("indexed", [True, False], ids=["indexed", "cut off"])
def test_a_chunk_of_an_absurd_length_costs_that_chunk(indexed: bool, whole: Path, tmp_path: Path) -> None:
    data = bytearray(whole.read_bytes())
    chunks = [at for opcode, at in starts_of(data) if opcode == 6]
    assert len(chunks) > PUSHES
    data[chunks[1] + 1 : chunks[1] + 9] = struct.pack("<Q", 2**50)
    spoilt = tmp_path / "a.mcap"
    spoilt.write_bytes(data if indexed else data[:-300])
    recovered = recover(spoilt)
    assert 0 < recovered.lost_bytes < (chunks[2] - chunks[1]) + 300
    assert len(list(read_messages(recovered.path, [Transition]))) >= PUSHES - 1
    assert grave(recovered.path) == []


@pytest.mark.parametrize(
    "how",
    [
        {"index_types": IndexType.NONE},
        {"use_statistics": False, "use_summary_offsets": False, "repeat_channels": False},
    ],
    ids=["no index", "no summary"],
)
def test_a_recording_without_index_or_summary_is_known_as_one(how: dict, whole: Path, tmp_path: Path) -> None:
    bare = rewritten(whole, tmp_path / "a.mcap", **how)
    with pytest.raises(RecordingError) as refused:
        show(bare)
    for words in (grave(bare)[0], str(refused.value)):
        assert "recover" in words
        assert "another program" not in words
    assert grave(recover(bare).path) == []


def test_a_file_without_messages_or_without_its_beginning_is_told(whole: Path, tmp_path: Path) -> None:
    empty = rewritten(whole, tmp_path / "a.mcap", lambda _topic, _count, _data: None)
    assert any("no message" in text for text in grave(empty))
    headless = rewritten(
        whole, tmp_path / "b.mcap", lambda topic, _count, data: None if topic == "/dipac/episode" else data
    )
    assert any("how it began" in finding.text for finding in check(headless))


@pytest.mark.parametrize("version", ["two", "-1", "", "3"])
def test_a_schema_that_is_no_number_is_not_called_newer(version: str, whole: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with whole.open("rb") as stream:
        metadata = next(record.metadata for record in make_reader(stream).iter_metadata())
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_metadata("dipac", {**metadata, "schema_version": version})
        writer.finish()
    (said,) = grave(path)
    assert ("newer" in said) == (version == "3")
    assert said.count(str(path)) == 1
    assert ".." not in said
