"""How a camera that gives no images is got going again: what to do next, given what can be seen of it. Pure.

The rungs, each tried when the one before has failed: wait; stop and start the stream; reset the camera and wait until
it is back on the bus; wait longer and longer between further tries. A capture process that has ended, or that hangs in
a call of the SDK, which nothing inside it can end, is replaced by a new one from any rung. A camera that is not there
is looked for until it is.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Literal, Self, TypeAlias, final

Step: TypeAlias = Literal["asked", "opening", "streaming", "closing", "resetting", "failed", "ended"]
"""What the capture process does; `asked`: it has not yet taken up what it was last told."""
Action: TypeAlias = Literal["open", "reset", "replace"]
"""What it is to do: stop what runs and open the camera; reset the camera and open it; make way for a new process."""
Phase: TypeAlias = Literal["starting", "streaming", "opening", "resetting", "waiting", "replacing", "ended"]


_LIVELY: Collection[Step] = ("asked", "streaming", "failed")
"""What a process does in short steps, with a sign of life after each."""
_DOING: Mapping[Step, str] = {
    "asked": "it was asked to open the camera",
    "opening": "opening the camera",
    "streaming": "waiting for images",
    "closing": "closing the stream",
    "resetting": "resetting the camera",
    "failed": "waiting to be told",
    "ended": "at its end",
}


@final
@dataclass(frozen=True, kw_only=True)
class Patience:
    """How long each rung gets [s].

    A camera of the D400 kind takes about a second from start to first image; LeRobot waits 5 s for one to come back
    from a reset. `steady_s`: images for so long make former failures forgotten. `absent_s`: between two looks for a
    camera that is not there. `slow_s` without a sign of life while opening or resetting, `close_s` while closing,
    `quiet_s` else, mean that a call hangs.
    """

    late_s: float = 1.0
    open_s: float = 15.0
    reset_s: float = 25.0
    quiet_s: float = 2.0
    slow_s: float = 15.0
    close_s: float = 5.0
    back_off_s: float = 1.0
    longest_back_off_s: float = 15.0
    absent_s: float = 1.0
    steady_s: float = 10.0


@final
@dataclass(frozen=True, kw_only=True)
class Sight:
    """What can be seen of a capture process from outside at `now_s`.

    `pulse_s`: its last sign of life; `image_s`: when its newest image came, -inf before the first; `failure`: why the
    last step failed; `absent`: because there is no such camera now; `death`: how the process ended, empty while it
    runs.
    """

    now_s: float
    pulse_s: float
    image_s: float
    step: Step
    failure: str = ""
    absent: bool = False
    death: str = ""


@final
@dataclass(frozen=True, kw_only=True)
class Ladder:
    """Where on the ladder a camera is, since when, until when it waits, and why.

    `failures` counts rungs that failed since images last came for a while; `streamed`: it has given images before, so
    it is ours to reset; `lost_s`: since when there are no images.
    """

    phase: Phase = "starting"
    since_s: float
    until_s: float = 0.0
    failures: int = 0
    streamed: bool = False
    lost_s: float
    why: str = ""

    @classmethod
    def at_start(cls, now_s: float) -> Self:
        """A first capture process has just been started and told to open its camera."""
        return cls(since_s=now_s, lost_s=now_s)

    def words(self, now_s: float) -> str:
        """The state for a person: what is wrong, since when, and what is done about it; empty where it streams."""
        if self.phase == "streaming":
            return ""
        if self.phase == "ended":
            return f"at its end: {self.why}"
        doing = {
            "starting": "the camera is being opened by a new process",
            "opening": "the stream is started anew",
            "resetting": "the camera is reset",
            "waiting": f"tried again in {max(0.0, self.until_s - now_s):.0f} s",
            "replacing": f"a new process starts in {max(0.0, self.until_s - now_s):.0f} s",
        }[self.phase]
        return f"no image for {max(0.0, now_s - self.lost_s):.0f} s{f' ({self.why})' if self.why else ''}: {doing}"


def climbed(ladder: Ladder, sight: Sight, patience: Patience) -> tuple[Ladder, Action | None]:
    """Where the camera is on the ladder now, and what its process is to be told."""
    if ladder.phase == "ended":
        return ladder, None
    if sight.step == "ended":
        return replace(ladder, phase="ended", since_s=sight.now_s, why=sight.failure), None
    if ladder.phase == "replacing":
        return _replaced(ladder, sight)
    if why := sight.death or _hung(sight, patience):
        return _to_replace(ladder, sight, why, patience)
    if ladder.phase == "streaming":
        return _watched(ladder, sight, patience)
    if ladder.phase == "waiting":
        return _again(ladder, sight)
    return _awaited(ladder, sight, patience)


def _watched(ladder: Ladder, sight: Sight, patience: Patience) -> tuple[Ladder, Action | None]:
    """Images come; the first rung is taken when they do not."""
    late = sight.now_s - sight.image_s > patience.late_s
    if late or sight.step == "failed":
        why = sight.failure or "the stream stands still"
        return replace(ladder, phase="opening", since_s=sight.now_s, lost_s=sight.image_s, why=why), "open"
    if ladder.failures and sight.now_s - ladder.since_s > patience.steady_s:
        return replace(ladder, failures=0), None
    return ladder, None


def _awaited(ladder: Ladder, sight: Sight, patience: Patience) -> tuple[Ladder, Action | None]:
    """Something has been told, and an image is to come of it."""
    if sight.image_s > ladder.since_s:
        return replace(ladder, phase="streaming", since_s=sight.now_s, streamed=True, why=""), None
    given_s = patience.reset_s if ladder.phase == "resetting" else patience.open_s
    if sight.step == "failed":
        return _failed(ladder, sight, sight.failure, patience)
    if sight.now_s - ladder.since_s > given_s:
        return _failed(ladder, sight, f"no image came within {given_s:.0f} s", patience)
    return ladder, None


def _failed(ladder: Ladder, sight: Sight, why: str, patience: Patience) -> tuple[Ladder, Action | None]:
    """The rung failed: the next one. What has never worked is not reset, for another program may be using it."""
    here = replace(ladder, since_s=sight.now_s, why=why)
    if sight.absent:
        return replace(here, phase="waiting", until_s=sight.now_s + patience.absent_s), None
    here = replace(here, failures=ladder.failures + 1)
    if ladder.phase != "resetting" and ladder.streamed:
        return replace(here, phase="resetting"), "reset"
    return replace(here, phase="waiting", until_s=sight.now_s + _back_off_s(here.failures, patience)), None


def _again(ladder: Ladder, sight: Sight) -> tuple[Ladder, Action | None]:
    """Wait, then begin at the first rung."""
    if sight.now_s < ladder.until_s:
        return ladder, None
    return replace(ladder, phase="opening", since_s=sight.now_s), "open"


def _to_replace(ladder: Ladder, sight: Sight, why: str, patience: Patience) -> tuple[Ladder, Action | None]:
    """The first loss of a process is made good at once, further ones later and later."""
    wait_s = _back_off_s(ladder.failures, patience) if ladder.failures else 0.0
    gone = replace(ladder, phase="replacing", until_s=sight.now_s + wait_s, failures=ladder.failures + 1, why=why)
    if ladder.phase == "streaming":
        gone = replace(gone, lost_s=sight.image_s)
    return _replaced(gone, sight)


def _replaced(ladder: Ladder, sight: Sight) -> tuple[Ladder, Action | None]:
    """Wait, then let a new process open the camera."""
    if sight.now_s < ladder.until_s:
        return ladder, None
    return replace(ladder, phase="starting", since_s=sight.now_s), "replace"


def _hung(sight: Sight, patience: Patience) -> str:
    """Why the process must be hanging; empty where it need not be."""
    quiet_s = sight.now_s - sight.pulse_s
    if quiet_s <= _silence_s(sight.step, patience):
        return ""
    return f"its process said nothing for {quiet_s:.0f} s while {_DOING[sight.step]}"


def _silence_s(step: Step, patience: Patience) -> float:
    """For how long a process may give no sign of life [s]."""
    if step in _LIVELY:
        return patience.quiet_s
    return patience.close_s if step == "closing" else patience.slow_s


def _back_off_s(failures: int, patience: Patience) -> float:
    """1, 2, 4, ... times the first, up to the longest [s]."""
    return min(patience.back_off_s * 2.0 ** min(failures - 1, 30), patience.longest_back_off_s)
