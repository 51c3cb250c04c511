"""Clip of a recording still being written: its last seconds, as a recording of their own.

Chunks from before the cut are skipped while still compressed, except those with a channel or a message that the clip
begins with: the message indexes that follow each chunk identify them.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from mcap.records import Channel, Chunk, McapRecord, Message, MessageIndex, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from app.core.dialogue.control import Mode
from app.core.errors import RecordingError
from app.core.messages import Episode, Goal, Model
from app.recording.format import digests
from app.recording.format.channels import METADATA, topic_of
from app.recording.format.clock_offset import Epoch
from app.recording.format.codec import encode
from app.recording.format.integrity import DAMAGE, damage_error
from app.recording.write.copying import write_records
from app.recording.write.file import metadata_of

_OPENING: Final = tuple(map(topic_of, (Model, Goal, Mode)))
"""Channels whose newest message from before it begins a clip."""
_EPISODE: Final = topic_of(Episode)


@final
@dataclass(frozen=True, kw_only=True)
class Cut:
    """Range of a session's recording: the first `size_bytes` of the file `session`, from the log time `since_ns` on.

    The bytes end with a complete record. `episode` replaces the session's own; both have the same `epoch`.
    """

    session: Path
    size_bytes: int
    since_ns: int
    episode: Episode
    epoch: Epoch


def write_clip(cut: Cut, goal: Path) -> None:
    """Write the clip to the new file `goal`, complete and indexed, and note its SHA-256.

    It begins with the episode and with the newest model, goal and mode from before the cut; all parts of a message have
    the same log time, so they stay together. Raises RecordingError where nothing was recorded since, the session's file
    is damaged or the new one cannot be written; nothing is left of it then.
    """
    draft = goal.with_suffix(".draft")
    try:
        write_records(_records(cut), draft)
        draft.replace(goal)
        digests.note(goal)
    except OSError as error:
        raise RecordingError(f"Cannot write {goal} ({error.strerror}); see its disk and its folder.") from error
    except DAMAGE as error:
        raise damage_error(cut.session, error) from error
    finally:
        draft.unlink(missing_ok=True)


def _records(cut: Cut) -> Iterator[McapRecord]:
    """The records of the clip, in order."""
    yield Metadata(name=METADATA, metadata=metadata_of(cut.episode, cut.epoch))
    before, first_ns = _Before(cut.since_ns), 0
    for chunk, channels in _chunks(cut):
        if not first_ns:
            before.look(chunk, channels)
        if chunk.message_end_time < cut.since_ns:
            continue
        records = breakup_chunk(chunk, validate_crc=True)
        times = [it.log_time for it in records if isinstance(it, Message) and it.log_time >= cut.since_ns]
        if not first_ns:
            first_ns = times[0]
            yield from before.opening(cut.episode, first_ns)
        for record in records:
            if not isinstance(record, Message) or (record.log_time >= cut.since_ns and not before.is_episode(record)):
                yield record
    if not first_ns:
        raise RecordingError("Nothing was recorded in that time; ask for more seconds.")


def _chunks(cut: Cut) -> Iterator[tuple[Chunk, Collection[int]]]:
    """Each chunk, still compressed, and the numbers of the channels that have messages in it."""
    with cut.session.open("rb") as stream:
        chunk, channels = None, set[int]()
        records = iter(StreamReader(stream, emit_chunks=True, record_size_limit=cut.size_bytes).records)
        while stream.tell() < cut.size_bytes:
            record = next(records)
            if isinstance(record, MessageIndex) and record.records:
                channels.add(record.channel_id)
            elif isinstance(record, Chunk):
                if chunk:
                    yield chunk, channels
                chunk, channels = record, set[int]()
        if chunk:
            yield chunk, channels


@final
class _Before:
    """Context of a clip from before it: schemas and channels, and the messages that it begins with."""

    def __init__(self, since_ns: int) -> None:
        self._since_ns = since_ns
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._newest: dict[str, list[Message]] = {}

    def look(self, chunk: Chunk, channels: Collection[int]) -> None:
        """Take schemas, channels and opening messages from the chunk, which has messages on these channels."""
        known = [self._channels[number].topic for number in channels if number in self._channels]
        if known and len(known) == len(channels) and not set(known) & set(_OPENING):
            return
        past = list[Message]()
        for record in breakup_chunk(chunk, validate_crc=True):
            match record:
                case Schema():
                    self._schemas[record.id] = record
                case Channel():
                    self._channels[record.id] = record
                case Message() if record.log_time < self._since_ns:
                    past.append(record)
                case _:
                    pass
        for message in past:
            topic = self._channels[message.channel_id].topic
            if topic in _OPENING:
                self._newest[topic] = [part for part in past if part.log_time == message.log_time]

    def is_episode(self, message: Message) -> bool:
        """True for the session's start message, which the clip replaces with its own."""
        channel = self._channels.get(message.channel_id)
        return channel is not None and channel.topic == _EPISODE

    def opening(self, episode: Episode, first_ns: int) -> Iterator[McapRecord]:
        """The episode, then the newest messages in order of publication, dated just before `first_ns`."""
        yield from self._schemas.values()
        yield from self._channels.values()
        number = next(number for number, channel in self._channels.items() if channel.topic == _EPISODE)
        began = Message(channel_id=number, log_time=0, publish_time=0, sequence=0, data=encode(episode, Episode))
        groups = [[began], *sorted(self._newest.values(), key=lambda group: group[0].log_time)]
        for index, group in enumerate(groups):
            at_ns = first_ns - len(groups) + index
            for part in group:
                part.log_time = part.publish_time = at_ns
                yield part
