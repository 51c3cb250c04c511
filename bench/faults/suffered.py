"""Outcomes of faults in the whole application: the arm's rest and limits, the log, and recovery."""

import re
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from mcap.reader import make_reader

from app.config import Limits
from app.core.dialogue.control import ModeName
from app.recording.library.checks import check
from app.recording.library.recover import recover
from bench.faults.driven import Driven, driven
from bench.faults.inject import kept, rest_s
from bench.faults.injections import MOVING, Kind
from bench.faults.place import site

_WATCHED_S: Final = 0.6
_BEFORE_S: Final = 1.0
_OFFSET: Final = "epoch_offset_ns"
_NEXT_STEP: Final = re.compile(
    r"dipac |press|close the rig|open it again|look at|calibrate|choose|plan again|plan and approve|make room|"
    r"starts with|wait for|thin this|start again|uncover|plan (inside|around)|reload|lower|"
    r"Speeds must|needs a speed"
)
"""Pattern of a sentence that names the next step."""


@final
@dataclass(frozen=True, kw_only=True)
class Came:
    """Outcome of a fault. `rest_ms`: NaN if the arm was not to stop; `log_s`: age of the newest message then."""

    kind: Kind
    mode: ModeName
    fault_s: float
    rest_ms: float
    within: bool
    went_on: bool
    says: str
    log_s: float = float("nan")
    log: str = ""
    """Defect of the log, if any."""

    @property
    def wrong(self) -> tuple[str, ...]:
        """Violated requirements, as sentences."""
        found = [self.log] if self.log else []
        if not self.within:
            found.append("the arm left its limits")
        if self.kind.silences and not self.rest_ms <= REST_MS:
            found.append(f"at rest only after {self.rest_ms:.0f} ms")
        if not self.log_s <= _LOST_S:
            found.append(f"the newest message is {self.log_s:.1f} s old")
        if not self.went_on and not _NEXT_STEP.search(self.says):
            found.append(f"it did not go on, and no next step is in {self.says!r}")
        if self.kind.says not in self.says:
            found.append(f"{self.kind.says!r} is not in {self.says!r}")
        return tuple(found)


REST_MS: Final = 250.0
_LOST_S: Final = 1.0


def sequence(mode: ModeName, kinds: Sequence[Kind], *options: str) -> list[Came]:
    """One fault after the other, in one application; one that ends it is the last."""
    with driven(*options) as one:
        begun = one.wait("begun")
        assert begun, one.errors()
        one.wait("Particles")
        came = [suffered(one, mode, kind) for kind in kinds]
        if not one.ended and not kinds[-1].ends:
            one.order("end")
            one.join()
        one.close()
        return [*logged(one.recording, came)]


def suffered(one: Driven, mode: ModeName, kind: Kind) -> Came:
    """Reach the middle of the mode's activity, inject the fault, and observe the outcome."""
    assert _in_the_middle(one, mode), one.errors()
    fault_s = time.monotonic()
    noticed_s = kind.do(one, mode) or fault_s
    time.sleep(max(0.0, noticed_s + _WATCHED_S - time.monotonic()))
    states = one.states()
    after = states[states["time_s"] >= noticed_s]
    rest_ms = 1e3 * (rest_s(after) - noticed_s) if kind.silences and len(after) else float("nan")
    within = _within(states[states["time_s"] >= fault_s - _BEFORE_S])
    kind.undo(one)
    went_on = not kind.ends and _goes_on(one, mode)
    return Came(
        kind=kind,
        mode=mode,
        fault_s=fault_s,
        rest_ms=rest_ms,
        within=within,
        went_on=went_on or (kind.ends and _says_nothing(kind)),
        says=_said(one, fault_s),
    )


def _says_nothing(kind: Kind) -> bool:
    """True for a fault that kills the application: only its log is left."""
    return kind.name in ("kill application", "terminate application")


def logged(path: Path, came: Sequence[Came]) -> list[Came]:
    """The outcomes with the log's messages about each, after recovery of the log if needed."""
    try:
        found = recover(path)
        times_s = _times_s(found.path)
    except Exception as error:
        return [replace(each, log=f"the log cannot be read: {error}") for each in came]
    grave = [finding.text for finding in check(found.path) if finding.grave]
    newest = [each.fault_s - times_s[times_s <= each.fault_s].max(initial=-np.inf) for each in came]
    return [replace(each, log_s=float(age_s), log="; ".join(grave)) for each, age_s in zip(came, newest, strict=True)]


def _times_s(path: Path) -> np.ndarray:
    """Times of a recording's messages, in monotonic time; read by the plain reader."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        told = next(each.metadata for each in reader.iter_metadata() if _OFFSET in each.metadata)
        times_ns = [message.log_time for _, _, message in reader.iter_messages()]
    return (np.array(times_ns) - int(told[_OFFSET])) / 1e9


def _in_the_middle(one: Driven, mode: ModeName) -> bool:
    """Wait until the arm is fast in a mode that moves it, or until the mode's activity in the others."""
    if mode == "teleoperate":
        return one.insists(mode, lambda since_s: _held(one, since_s) and one.fast(since_s))
    if mode in MOVING:
        return one.insists(mode, one.fast)
    return one.insists(mode, partial(_heard, one, "Proposal" if mode == "plan only" else "Health", ""))


def _goes_on(one: Driven, mode: ModeName) -> bool:
    """True if it completes its mode's activity once more, after Resume if something stopped it."""
    match mode:
        case "idle":
            return one.insists(mode, partial(_heard, one, "Particles", ""))
        case "plan only":
            return one.insists(mode, partial(_heard, one, "Proposal", ""))
        case "teleoperate":
            return _in_the_middle(one, mode) and _let_go(one)
        case _:
            return one.insists(mode, partial(_heard, one, "Executed", "completed"))


def _heard(one: Driven, kind: str, says: str, since_s: float) -> bool:
    return any(says in each["words"] for each in one.heard(kind, after_s=since_s))


def _held(one: Driven, since_s: float) -> bool:
    """Press once it is waited for; a hand that is refused presses again."""
    if not _heard(one, "Health", "waiting to be moved by hand", since_s):
        return False
    if not one.fast(since_s):
        one.order("hold")
        time.sleep(0.2)
    return True


def _let_go(one: Driven) -> bool:
    since_s = time.monotonic()
    one.order("release")
    return one.wait("Executed", after_s=since_s) is not None


def _within(states: Any) -> bool:
    limits: Limits = site(Path()).limits
    return kept(states, limits) and limits.entered_volume(states["commanded"][:, :3]) is None


def _said(one: Driven, since_s: float) -> str:
    """Its fault messages, the newest last."""
    faults = [each["words"].strip() for each in one.heard("Fault", after_s=since_s)]
    last = one.join() if one.ended else None
    return " | ".join([*dict.fromkeys(faults), *([last["error"]] if last else [])])
