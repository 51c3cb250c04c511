"""Recordings that cannot be read are refused with an error of one line."""

from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from app.core.errors import DipacError, RecordingError, UsageError
from app.recording.format.channels import SCHEMA_VERSION
from app.recording.library.recover import recover
from app.recording.read.reader import read_episode, read_messages, read_transitions
from tests.recording.samples import Recording


def mcap_of(folder: Path, **metadata: dict[str, str]) -> Path:
    """A whole MCAP file with these metadata records and nothing else."""
    path = folder / "other.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        for name, record in metadata.items():
            writer.add_metadata(name, record)
        writer.finish()
    return path


def test_a_recording_that_is_not_there_is_named_with_those_that_are(recording: Recording) -> None:
    missing = recording.path.with_name(f"{recording.path.stem}-2.mcap")
    with pytest.raises(UsageError, match=rf"Unknown recording .*Did you mean .*{recording.path.name}"):
        read_messages(missing)


def test_a_folder_is_no_recording(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"is a folder; name its recordings: .*/\*\.mcap"):
        read_messages(tmp_path)


@pytest.mark.parametrize("read", [read_messages, recover])
def test_a_file_that_cannot_be_read_is_said_in_one_line(read: Callable[[Path], object]) -> None:
    refuses_its_first_byte = Path("/proc/self/mem")
    with pytest.raises(RecordingError, match=r"Cannot read /proc/self/mem \(.*make sure") as caught:
        read(refuses_its_first_byte)
    assert "\n" not in str(caught.value)


def test_a_recording_that_goes_away_before_it_is_read_is_said(recording: Recording, tmp_path: Path) -> None:
    path = tmp_path / "brief.mcap"
    path.write_bytes(recording.path.read_bytes())
    messages = read_messages(path)
    path.unlink()
    with pytest.raises(RecordingError, match="make sure that it is there"):
        next(messages)


def compressed_otherwise(recording: Path, path: Path) -> Path:
    """The same recording, with its chunks compressed by Zstandard, and without sums, as other programs write them."""
    with recording.open("rb") as read, path.open("wb") as write:
        writer = Writer(write, compression=CompressionType.ZSTD, enable_crcs=False)
        reader = make_reader(read)
        writer.start()
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, record.metadata)
        known = dict[int, int]()
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if channel.id not in known:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data) if schema else 0
                known[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, kind)
            writer.add_message(known[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()
    return path


def test_a_damaged_chunk_of_zstandard_is_damage_as_any_other(recording: Recording, tmp_path: Path) -> None:
    path = compressed_otherwise(recording.path, tmp_path / "zstd.mcap")
    assert len(list(read_messages(path))) == len(recording.messages)
    data = bytearray(path.read_bytes())
    begin = data.index(b"\x28\xb5\x2f\xfd") + 4  # Behind the magic number of a frame.
    data[begin : begin + 8] = b"\xff" * 8
    path.write_bytes(data)
    with pytest.raises(RecordingError) as refused:
        list(read_messages(path))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("content", [b"", b"\x89PNG\r\n\x1a\n", b"[model]\nstiffness = 1.0\n"])
def test_a_file_of_another_kind_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "file.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="is not an MCAP file"):
        read_messages(path)


def test_an_mcap_file_of_another_program_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="another program"):
        read_messages(mcap_of(tmp_path, rosbag={"version": "5"}))


@pytest.mark.parametrize("version", [str(SCHEMA_VERSION + 1), "99"])
def test_a_newer_schema_is_refused_with_the_next_step(version: str, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="update dipac"):
        read_messages(mcap_of(tmp_path, dipac={"schema_version": version}))


def test_a_recording_without_an_episode_is_refused(tmp_path: Path) -> None:
    path = mcap_of(tmp_path, dipac={"schema_version": str(SCHEMA_VERSION)})
    assert read_transitions(path) == []
    with pytest.raises(RecordingError, match="names no episode"):
        read_episode(path)


@pytest.mark.parametrize("read", [read_messages, read_transitions, read_episode])
def test_a_recording_that_was_cut_off_names_the_command_that_mends_it(
    read: Callable[[Path], object], recording: Recording, tmp_path: Path
) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(recording.path.read_bytes()[:-1])
    with pytest.raises(RecordingError, match=rf"`dipac recover {path}`"):
        read(path)


def test_damage_is_found_while_reading_and_names_the_command_that_mends_it(
    recording: Recording, tmp_path: Path
) -> None:
    data = bytearray(recording.path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=rf"`dipac recover {path}`") as caught:
        list(read_messages(path))
    assert isinstance(caught.value, DipacError)
    assert "\n" not in str(caught.value)
