"""Schema migrations: pure functions of plain JSON, from each version of the format to the next.

A version has one function for each channel whose messages differ from the version before; everything else is the same
in both. The functions are chained, so that none from a version to a much later one is ever written.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, TypeAlias, TypeVar

import msgspec

from app.core.messages import Message
from app.recording.format.channels import SCHEMA_VERSION
from app.recording.format.codec import rebuild

MessageT = TypeVar("MessageT", bound=Message)

Plain: TypeAlias = dict[str, Any]
"""A message as JSON holds it."""

Step: TypeAlias = Mapping[str, Callable[[Plain], Plain]]
"""Changes of one version, by channel."""


def _doing(old: Plain) -> Plain:
    """Version 2: the program's activity was called its mode, before it had modes."""
    return {"doing" if name == "mode" else name: value for name, value in old.items()}


STEPS: Final[Sequence[Step]] = ({"/dipac/health": _doing},)
"""Steps from version 1 to 2, from 2 to 3 and so on. Channels have their names of that version."""


def migrate_message(plain: Plain, topic: str, version: int) -> Plain:
    """A message on the channel `topic` in a file of `version`, in the newest version's form."""
    for step in STEPS[version - 1 :]:
        if topic in step:
            plain = step[topic](plain)
    return plain


def changed_since(version: int) -> frozenset[str]:
    """Channels whose messages in the newest version differ from those in `version`."""
    return frozenset(topic for step in STEPS[version - 1 :] for topic in step)


def decode_of(version: int, data: bytes, topic: str, kind: type[MessageT]) -> MessageT:
    """The message of type `kind` in `data`, from the channel `topic` of a file of `version`.

    Raises as `codec.decode`.
    """
    return rebuild(migrate_message(msgspec.json.decode(data), topic, version), kind)


assert len(STEPS) == SCHEMA_VERSION - 1, "each version has its step from the one before"
