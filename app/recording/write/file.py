"""One MCAP file being written. Not for several threads at once; nothing here is asynchronous."""

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any, final

import foxglove
from foxglove.mcap import MCAPCompression, MCAPWriteOptions

from app.core.messages import Episode, Message, Transition
from app.recording.format.channels import METADATA, SCHEMA_VERSION, record_of, topic_of
from app.recording.format.clock_offset import Epoch
from app.recording.format.codec import encode, schema
from app.recording.format.lock import hold
from app.recording.write.foxglove_messages import Viewable, views


@final
class EpisodeFile:
    """Writer of messages, each with its Foxglove views, to a new file at `path`.

    Without an `epoch`, messages are dated by this machine's clocks.
    """

    def __init__(self, path: Path, episode: Episode, *, epoch: Epoch | None = None) -> None:
        self.path = path
        self.epoch = epoch or Epoch.now()
        self._context = foxglove.Context()
        self._channels: dict[str, foxglove.Channel] = {}
        self._log_time_ns = 0
        self._unflushed = False
        self._mcap = foxglove.open_mcap(path, context=self._context, writer_options=_options())
        self._lock = hold(path)
        self._mcap.write_metadata(METADATA, metadata_of(episode, self.epoch))
        self.flush()

    def write(self, message: Message, *, now_s: float) -> None:
        """Append `message`, which arrived at monotonic time `now_s` [s].

        The parts of a message precede it at the same log time, and no two messages share one. Errors of the disk are
        kept by the SDK until the next `flush`, which is at the end of each push at the latest.
        """
        self._log_time_ns = max(self._log_time_ns + 1, self.epoch.ns(now_s))
        for topic, view in views(message, self.epoch):
            self._view_channel(topic, view).log(view.encode(), log_time=self._log_time_ns)
        data = encode(message, record_of(type(message)))
        self._json_channel(type(message)).log(data, log_time=self._log_time_ns)
        self._unflushed = True
        if isinstance(message, Transition):
            self.flush()  # Damage to the chunk that ends here costs one push.

    def flush(self) -> None:
        """Hand everything written to the operating system, where it survives a kill of this process.

        Raises RuntimeError where the disk refuses.
        """
        if self._unflushed or not self._channels:
            self._mcap.flush()
            self._unflushed = False

    @property
    def size_bytes(self) -> int:
        """Bytes of the file that the operating system has."""
        return os.fstat(self._lock).st_size

    def close(self) -> None:
        """Finish the file with its index and put it on the disk. Raises RuntimeError or OSError where that fails."""
        try:
            self._mcap.close()
            os.fsync(self._lock)
        finally:
            os.close(self._lock)
            for channel in self._channels.values():
                channel.close()

    def _view_channel(self, topic: str, view: Viewable) -> foxglove.Channel:
        if topic not in self._channels:
            self._channels[topic] = foxglove.Channel(
                topic, schema=view.get_schema(), message_encoding="protobuf", context=self._context
            )
        return self._channels[topic]

    def _json_channel(self, kind: type[Message]) -> foxglove.Channel:
        topic = topic_of(kind)
        if topic not in self._channels:
            self._channels[topic] = foxglove.Channel(
                topic, schema=_json_schema(kind), message_encoding="json", context=self._context
            )
        return self._channels[topic]


def metadata_of(episode: Episode, epoch: Epoch) -> dict[str, str]:
    """The episode as MCAP metadata strings, with the keys needed to read the rest."""
    fields: dict[str, Any] = asdict(episode)
    written = {key: value if isinstance(value, str) else json.dumps(value) for key, value in fields.items()}
    return written | {"schema_version": str(SCHEMA_VERSION), "epoch_offset_ns": str(epoch.offset_ns)}


def _json_schema(kind: type[Message]) -> foxglove.Schema:
    data = json.dumps(schema(record_of(kind)), allow_nan=False).encode()
    return foxglove.Schema(name=f"dipac.{kind.__name__}", encoding="jsonschema", data=data)


def _options() -> MCAPWriteOptions:
    """Options of the writer: LZ4 halves depth images for 1 ms, where zstd takes ten times that.

    docs/recording-format.md has the measurement. Without seeking a chunk reaches the file in one piece, so that a
    killed process leaves a file that ends with a complete one.
    """
    return MCAPWriteOptions(compression=MCAPCompression.Lz4, chunk_size=1 << 20, disable_seeking=True)
