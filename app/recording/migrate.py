"""What older versions wrote, as the newest one would have: pure functions of plain JSON, from each version to the next.

A version has one function for each channel whose messages it writes otherwise than the one before; everything else is
the same in both. The functions are chained, so that nobody ever writes one from a version to one far later.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, TypeAlias, TypeVar

import msgspec

from app.core.messages import Message
from app.recording.channels import SCHEMA_VERSION
from app.recording.codec import rebuild

MessageT = TypeVar("MessageT", bound=Message)

Plain: TypeAlias = dict[str, Any]
"""A message as JSON holds it."""

Step: TypeAlias = Mapping[str, Callable[[Plain], Plain]]
"""What one version changed, by channel."""


def _doing(old: Plain) -> Plain:
    """Version 2: what the program is doing was called its mode, before it had modes."""
    return {"doing" if name == "mode" else name: value for name, value in old.items()}


STEPS: Final[Sequence[Step]] = ({"/dipac/health": _doing},)
"""From version 1 to 2, from 2 to 3 and so on. Channels are named as they were then."""


def migrated(plain: Plain, topic: str, version: int) -> Plain:
    """A message on the channel `topic` in a file of `version`, as the newest version has it."""
    for step in STEPS[version - 1 :]:
        if topic in step:
            plain = step[topic](plain)
    return plain


def changed_since(version: int) -> frozenset[str]:
    """The channels on which the newest version writes otherwise than `version` did."""
    return frozenset(topic for step in STEPS[version - 1 :] for topic in step)


def decode_of(version: int, data: bytes, topic: str, kind: type[MessageT]) -> MessageT:
    """The message of type `kind` in `data`, from the channel `topic` of a file of `version`.

    Raises as `codec.decode`.
    """
    return rebuild(migrated(msgspec.json.decode(data), topic, version), kind)


assert len(STEPS) == SCHEMA_VERSION - 1, "each version has its step from the one before"
