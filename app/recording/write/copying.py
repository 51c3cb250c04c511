"""A new, indexed MCAP file from the records of another."""

from collections.abc import Iterable
from pathlib import Path
from typing import Final

from mcap.records import Attachment, Channel, McapRecord, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer

_CHUNK_BYTES: Final = 1 << 17
"""Size of a chunk before it is compressed, at the least: what one fault of a disk costs."""


def write_records(records: Iterable[McapRecord], goal: Path) -> int:
    """Write `records` to a new file with an index; returns the number of messages.

    Schemas and channels get new numbers; a message before its channel is left out.
    """
    messages = 0
    schemas: dict[int, int] = {0: 0}
    channels: dict[int, int] = {}
    with goal.open("wb") as stream:
        writer = Writer(stream, chunk_size=_CHUNK_BYTES, compression=CompressionType.LZ4)
        writer.start()
        for record in records:
            match record:
                case Metadata(name=name, metadata=metadata):
                    writer.add_metadata(name, metadata)
                case Attachment():
                    writer.add_attachment(
                        record.create_time, record.log_time, record.name, record.media_type, record.data
                    )
                case Schema(id=old, name=name, encoding=encoding, data=data) if old not in schemas:
                    schemas[old] = writer.register_schema(name, encoding, data)
                case Channel(id=old, schema_id=schema) if old not in channels and schema in schemas:
                    channels[old] = writer.register_channel(
                        record.topic, record.message_encoding, schemas[schema], record.metadata
                    )
                case Message() if record.channel_id in channels:
                    writer.add_message(
                        channels[record.channel_id],
                        record.log_time,
                        record.data,
                        record.publish_time,
                        record.sequence,
                    )
                    messages += 1
                case _:
                    continue
        writer.finish()
    return messages
