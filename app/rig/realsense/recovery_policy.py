"""Camera recovery policy: the next restart step for an observed camera state. Pure.

The steps, each tried when the one before has failed: wait; restart the stream; reset the camera and wait until it is
back on the bus; back off with growing delays between further tries. A capture process that has ended, or that hangs in
a call of the SDK, which nothing inside it can end, is replaced by a new one at any step. A missing camera is searched
for until it is there.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Literal, Self, TypeAlias, final

Step: TypeAlias = Literal["asked", "opening", "streaming", "closing", "resetting", "failed", "ended"]
"""Current step of the capture process; `asked`: it has not yet taken up the last command."""
Action: TypeAlias = Literal["open", "reset", "replace"]
"""Command to the process: restart the stream; reset the camera and open it; end in favour of a new process."""
Phase: TypeAlias = Literal["starting", "streaming", "opening", "resetting", "waiting", "replacing", "ended"]


_LIVELY: Collection[Step] = ("asked", "streaming", "failed")
"""Steps in which a process sends frequent heartbeats."""
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
class RecoveryTimeouts:
    """Timeouts of the recovery [s].

    A camera of the D400 kind takes about a second from start to first image; LeRobot waits 5 s for one to come back
    from a reset. `steady_s`: duration of images after which failures are forgotten. `absent_s`: interval between
    searches for a missing camera. Without a heartbeat, a call counts as hanging after `slow_s` while opening or
    resetting, `close_s` while closing, `quiet_s` otherwise.
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
class CaptureStatus:
    """Observation of a capture process at `now_s`.

    `pulse_s`: time of its last heartbeat; `image_s`: arrival of its newest image, -inf before the first; `failure`:
    reason why the last step failed; `absent`: it failed for want of the camera; `death`: reason for the end of the
    process, empty while it runs.
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
    """State of the recovery: the phase, its start, the end of a wait, and the reason.

    `failures` counts failed steps since images last came steadily; `streamed`: it has given images before, so it is
    ours to reset; `lost_s`: start of the loss of images.
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
        """State after a first capture process has been started and told to open its camera."""
        return cls(since_s=now_s, lost_s=now_s)

    def words(self, now_s: float) -> str:
        """State for an operator: the problem, its duration, and the recovery in progress; empty where it streams."""
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


def climb(ladder: Ladder, sight: CaptureStatus, timeouts: RecoveryTimeouts) -> tuple[Ladder, Action | None]:
    """Next state of the recovery, and the command for the process."""
    if ladder.phase == "ended":
        return ladder, None
    if sight.step == "ended":
        return replace(ladder, phase="ended", since_s=sight.now_s, why=sight.failure), None
    if ladder.phase == "replacing":
        return _replace(ladder, sight)
    if why := sight.death or _hung(sight, timeouts):
        return _to_replace(ladder, sight, why, timeouts)
    if ladder.phase == "streaming":
        return _watch_images(ladder, sight, timeouts)
    if ladder.phase == "waiting":
        return _again(ladder, sight)
    return _wait(ladder, sight, timeouts)


def _watch_images(ladder: Ladder, sight: CaptureStatus, timeouts: RecoveryTimeouts) -> tuple[Ladder, Action | None]:
    """Watch incoming images; take the first step when they stop."""
    late = sight.now_s - sight.image_s > timeouts.late_s
    if late or sight.step == "failed":
        why = sight.failure or "the stream stands still"
        return replace(ladder, phase="opening", since_s=sight.now_s, lost_s=sight.image_s, why=why), "open"
    if ladder.failures and sight.now_s - ladder.since_s > timeouts.steady_s:
        return replace(ladder, failures=0), None
    return ladder, None


def _wait(ladder: Ladder, sight: CaptureStatus, timeouts: RecoveryTimeouts) -> tuple[Ladder, Action | None]:
    """Wait for the first image after a command."""
    if sight.image_s > ladder.since_s:
        return replace(ladder, phase="streaming", since_s=sight.now_s, streamed=True, why=""), None
    given_s = timeouts.reset_s if ladder.phase == "resetting" else timeouts.open_s
    if sight.step == "failed":
        return _after_failure(ladder, sight, sight.failure, timeouts)
    if sight.now_s - ladder.since_s > given_s:
        return _after_failure(ladder, sight, f"no image came within {given_s:.0f} s", timeouts)
    return ladder, None


def _after_failure(
    ladder: Ladder, sight: CaptureStatus, why: str, timeouts: RecoveryTimeouts
) -> tuple[Ladder, Action | None]:
    """Take the step after a failed one. A camera that never worked is not reset: another program may be using it."""
    here = replace(ladder, since_s=sight.now_s, why=why)
    if sight.absent:
        return replace(here, phase="waiting", until_s=sight.now_s + timeouts.absent_s), None
    here = replace(here, failures=ladder.failures + 1)
    if ladder.phase != "resetting" and ladder.streamed:
        return replace(here, phase="resetting"), "reset"
    return replace(here, phase="waiting", until_s=sight.now_s + _back_off_s(here.failures, timeouts)), None


def _again(ladder: Ladder, sight: CaptureStatus) -> tuple[Ladder, Action | None]:
    """Wait, then restart from the first step."""
    if sight.now_s < ladder.until_s:
        return ladder, None
    return replace(ladder, phase="opening", since_s=sight.now_s), "open"


def _to_replace(
    ladder: Ladder, sight: CaptureStatus, why: str, timeouts: RecoveryTimeouts
) -> tuple[Ladder, Action | None]:
    """Replace the process: at once the first time, later ones after growing delays."""
    wait_s = _back_off_s(ladder.failures, timeouts) if ladder.failures else 0.0
    gone = replace(ladder, phase="replacing", until_s=sight.now_s + wait_s, failures=ladder.failures + 1, why=why)
    if ladder.phase == "streaming":
        gone = replace(gone, lost_s=sight.image_s)
    return _replace(gone, sight)


def _replace(ladder: Ladder, sight: CaptureStatus) -> tuple[Ladder, Action | None]:
    """Wait, then have a new process open the camera."""
    if sight.now_s < ladder.until_s:
        return ladder, None
    return replace(ladder, phase="starting", since_s=sight.now_s), "replace"


def _hung(sight: CaptureStatus, timeouts: RecoveryTimeouts) -> str:
    """Description of a hanging call; empty where none is indicated."""
    quiet_s = sight.now_s - sight.pulse_s
    if quiet_s <= _silence_s(sight.step, timeouts):
        return ""
    return f"its process said nothing for {quiet_s:.0f} s while {_DOING[sight.step]}"


def _silence_s(step: Step, timeouts: RecoveryTimeouts) -> float:
    """Longest time without a heartbeat [s]."""
    if step in _LIVELY:
        return timeouts.quiet_s
    return timeouts.close_s if step == "closing" else timeouts.slow_s


def _back_off_s(failures: int, timeouts: RecoveryTimeouts) -> float:
    """Delay before the next try [s]: 1, 2, 4, ... times the first, up to the longest."""
    return min(timeouts.back_off_s * 2.0 ** min(failures - 1, 30), timeouts.longest_back_off_s)
