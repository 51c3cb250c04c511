"""Log times of a recording's messages by channel, from MCAP's own index; no image is read."""

import io
from collections.abc import Mapping, Sequence
from typing import IO, Final, TypeAlias

from mcap.data_stream import ReadDataStream
from mcap.reader import McapReader
from mcap.records import ChunkIndex, MessageIndex
from mcap.summary import Summary

from app.core.messages import Frame
from app.recording.format.channels import TOPICS, color_topic

Times: TypeAlias = Mapping[str, Sequence[int]]
"""Log times [ns] by topic, in order."""

_BEFORE, _AFTER = color_topic("\n").split("\n")
"""Parts of a colour channel's name before and after the camera's name."""
_RECORD_HEAD_BYTES: Final = 1 + 8
"""Size of a record's header, its opcode and length (https://mcap.dev/spec)."""


def log_times(reader: McapReader, stream: IO[bytes]) -> Times:
    """The log times of all messages that `reader` finds in `stream`.

    A file whose chunks have no index of their own is read through instead, which takes longer.
    """
    summary = reader.get_summary()
    if summary is None or not all(chunk.message_index_offsets for chunk in summary.chunk_indexes):
        return _read_through(reader)
    times: dict[str, list[int]] = {channel.topic: [] for channel in summary.channels.values()}
    for chunk in sorted(summary.chunk_indexes, key=lambda chunk: chunk.chunk_start_offset):
        _add_chunk(times, chunk, summary, stream)
    return times if any(times.values()) else _read_through(reader)


def frame_times(times: Times) -> Times:
    """Log times of each camera's frames, by its name: a frame has its colours at its own time on their channel."""
    framed = set(times.get(TOPICS[Frame], ()))
    coloured = {topic: each for topic, each in times.items() if topic.startswith(_BEFORE) and topic.endswith(_AFTER)}
    return {
        topic.removeprefix(_BEFORE).removesuffix(_AFTER): [time for time in each if time in framed]
        for topic, each in coloured.items()
    }


def _add_chunk(times: dict[str, list[int]], chunk: ChunkIndex, summary: Summary, stream: IO[bytes]) -> None:
    for channel, offset in chunk.message_index_offsets.items():
        stream.seek(offset + _RECORD_HEAD_BYTES, io.SEEK_SET)
        index = MessageIndex.read(ReadDataStream(stream))
        times[summary.channels[channel].topic] += [log_time_ns for log_time_ns, _ in index.records]


def _read_through(reader: McapReader) -> Times:
    times: dict[str, list[int]] = {}
    for _, channel, message in reader.iter_messages(log_time_order=False):
        times.setdefault(channel.topic, []).append(message.log_time)
    return times
