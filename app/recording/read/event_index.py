"""Event index of a recording: plans, decisions, motions, stops, faults."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, final

from app.core.dialogue.approval import Approved
from app.core.messages import Decision, Executed, Fault, Proposal, StopRequest, Transition
from app.recording.format.channels import TOPICS
from app.recording.format.index import Times
from app.recording.read.reader import Logged

MarkKind: TypeAlias = Literal["plan", "decision", "motion", "end", "seen", "stop", "fault"]
"""Kind of event: a plan offered; a decision; a motion's start; its end; the observation after it; STOP; a fault."""

_NS = 1_000_000_000


@final
@dataclass(frozen=True, kw_only=True)
class Mark:
    """An event `time_s` after the first message, in words."""

    time_s: float
    kind: MarkKind
    text: str


def marks_of(times: Times, history: Sequence[Logged], first_ns: int) -> Iterator[Mark]:
    """The marks of a recording in order, from the log times of its channels and its short messages."""
    found = [*_numbered_marks(times), *_message_marks(history)]
    for time_ns, kind, text in sorted(found, key=lambda mark: mark[0]):
        yield Mark(time_s=(time_ns - first_ns) / _NS, kind=kind, text=text)


def _numbered_marks(times: Times) -> Iterator[tuple[int, MarkKind, str]]:
    plans, leaves, ends, sights = (times.get(TOPICS[kind], ()) for kind in (Proposal, Approved, Executed, Transition))
    for number, time_ns in enumerate(plans, start=1):
        yield time_ns, "plan", f"plan {number}"
    for number, end_ns in enumerate(ends, start=1):
        before_ns = ends[number - 2] if number > 1 else -1
        yield _began(before_ns, end_ns, leaves, plans), "motion", f"motion {number}"
        yield end_ns, "end", f"motion {number} ends"
    for time_ns in sights:
        yield time_ns, "seen", f"the object after motion {bisect_left(ends, time_ns)}"


def _began(before_ns: int, end_ns: int, *told: Sequence[int]) -> int:
    """Log time of a motion's approval, or else of its plan, later than `before_ns`; or else of its end at `end_ns`."""
    for times in told:
        if (found := bisect_right(times, end_ns)) and times[found - 1] > before_ns:
            return times[found - 1]
    return end_ns


def _message_marks(history: Sequence[Logged]) -> Iterator[tuple[int, MarkKind, str]]:
    for time_ns, message in history:
        match message:
            case Decision():
                said = "approved" if message.approve else f"rejected: {message.reason or 'no reason given'}"
                yield time_ns, "decision", said
            case StopRequest():
                yield time_ns, "stop", f"STOP by {message.operator}"
            case Fault():
                yield time_ns, "fault", f"{message.where}: {message.text}"
            case _:
                pass
