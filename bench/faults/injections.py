"""Faults of the whole application: injection, required reaction of the arm, and the modes that they apply to."""

import os
import resource
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final, final

from app.core.dialogue.control import MODES, ModeName
from bench.faults.driven import PATIENCE_S, Driven
from bench.faults.standin import FINDS, PLANS

PLANNING: Final[tuple[ModeName, ...]] = ("plan only", "approve each", "automatic")
MOVING: Final[tuple[ModeName, ...]] = ("teleoperate", "approve each", "automatic")
_DECIDED: Final[tuple[ModeName, ...]] = ("approve each",)
_BY_HAND: Final[tuple[ModeName, ...]] = ("teleoperate",)
_LEARNING: Final[tuple[ModeName, ...]] = ("approve each", "automatic")

_HUNG_S: Final = 1.0
_ARM_HUNG_S: Final = 0.3
"""Hang of the arm's process: longer than the watchdog's timeout, shorter than the application's."""
_FLOOD: Final = 5000
_WATCHED_S: Final = 0.6

Do = Callable[[Driven, ModeName], float | None]


@final
@dataclass(frozen=True, kw_only=True)
class Kind:
    """One kind of fault. `do` returns when the arm's process could notice, where that is later than the fault.

    `silences`: nobody tells the arm anything any more, so it has to be at rest. `ends`: the application ends by it, or
    needs to be ended. `says`: what has to be said of it. `undo`: whatever has to be put right before it can go on.
    """

    name: str
    do: Do
    modes: tuple[ModeName, ...] = MODES
    silences: bool = False
    ends: bool = False
    says: str = ""
    undo: Callable[[Driven], None] = lambda _: None


def _there(target: str, one: Driven) -> int:
    """The process of that name, waited for: it calibrates after a motion, and a planner begins when it is asked."""
    until_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < until_s and not one.ended:
        if pid := one.process_id(target):
            return pid
        if target == "planner":
            one.order("plans", plans="sound")
        time.sleep(0.2)
    raise AssertionError(f"there is no {target}; {one.errors()}")


def _signalled(target: str, number: signal.Signals, one: Driven, _: ModeName) -> None:
    os.kill(_there(target, one), number)


def _hung(target: str, duration_s: float, one: Driven, _: ModeName) -> float | None:
    """Stop a process for a while; the arm's own can notice when it goes on, and that is then."""
    pid = _there(target, one)
    os.kill(pid, signal.SIGSTOP)
    time.sleep(duration_s)
    on_s = time.monotonic()
    os.kill(pid, signal.SIGCONT)
    return on_s if target == "arm" else None


def _ordered(name: str, one: Driven, _: ModeName, **told: object) -> None:
    one.order(name, **told)


def _absurd(plans: str, one: Driven, mode: ModeName) -> None:
    """Have plans made like this, and wait until one was refused, or looked at."""
    since_s = time.monotonic()
    one.order("plans", plans=plans)
    one.insists(mode, lambda _: bool(one.heard("Proposal" if mode == "plan only" else "Fault", after_s=since_s)))


def _misnamed(one: Driven, mode: ModeName) -> None:
    """Approve by numbers that are not those of the plan."""
    since_s = time.monotonic()
    one.order("misname", digest="0" * 64)
    one.insists(
        mode, lambda _: any("not the motion shown" in it["words"] for it in one.heard("Notice", after_s=since_s))
    )


def _found(finds: str, one: Driven, _: ModeName) -> None:
    since_s = time.monotonic()
    one.order("finds", finds=finds)
    _noticed(one, since_s)


def _shown(shows: str, one: Driven, _: ModeName) -> None:
    since_s = time.monotonic()
    one.order("cameras", shows=shows)
    _noticed(one, since_s)


def _noticed(one: Driven, since_s: float) -> None:
    """Wait until the fault is announced, or an observation succeeds all the same."""
    until_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < until_s and not one.ended:
        if one.heard("Fault", after_s=since_s) or len(one.heard("Particles", after_s=since_s + _WATCHED_S)) > 1:
            return
        time.sleep(0.05)


def _filled(one: Driven, _: ModeName) -> None:
    """Keep the recording from growing, as on a full disk."""
    size = one.recording.stat().st_size
    hard = resource.prlimit(one.pid, resource.RLIMIT_FSIZE)[1]
    resource.prlimit(one.pid, resource.RLIMIT_FSIZE, (size, hard))
    one.join()


def _waited(name: str, one: Driven, mode: ModeName) -> None:
    """Kill a process that perception needs, and wait until that is announced."""
    since_s = time.monotonic()
    _signalled(name, signal.SIGKILL, one, mode)
    one.wait("Fault", "close the rig", after_s=since_s)


def _arm_killed(one: Driven, mode: ModeName) -> None:
    _signalled("arm", signal.SIGKILL, one, mode)
    one.join()


def _arm_lost(one: Driven, mode: ModeName) -> None:
    """Stop the arm's process for good."""
    _signalled("arm", signal.SIGSTOP, one, mode)
    one.join()


def _sound(one: Driven) -> None:
    one.order("plans", plans="sound")
    one.order("misname", digest="")


def _true(one: Driven) -> None:
    one.order("finds", finds="true")
    one.order("cameras", shows="all")


_WORKERS: Final = ("planner", "perception")
_KILL, _TERMINATE = signal.SIGKILL, signal.SIGTERM
KINDS: Final[tuple[Kind, ...]] = (
    *(Kind(name=f"kill {it}", do=partial(_signalled, it, _KILL)) for it in _WORKERS),
    *(Kind(name=f"hang {it}", do=partial(_hung, it, _HUNG_S)) for it in (*_WORKERS, "cameras", "world")),
    Kind(name="kill calibrator", do=partial(_signalled, "calibrator", _KILL), modes=_LEARNING),
    Kind(name="hang calibrator", do=partial(_hung, "calibrator", _HUNG_S), modes=_LEARNING),
    Kind(name="hang arm", do=partial(_hung, "arm", _ARM_HUNG_S), silences=True),
    Kind(name="hang application", do=partial(_hung, "application", _HUNG_S), silences=True),
    Kind(name="hang the event loop", do=partial(_ordered, "block", duration_s=_HUNG_S), modes=_LEARNING, silences=True),
    Kind(name="freeze the clock", do=partial(_ordered, "freeze", duration_s=_HUNG_S)),
    Kind(name="STOP", do=partial(_ordered, "stop"), silences=True),
    *(
        Kind(name=f"flood of {it}", do=partial(_ordered, "flood", count=_FLOOD, what=it), silences=it == "stops")
        for it in ("modes", "decisions", "stops")
    ),
    Kind(name="the page is gone", do=partial(_ordered, "vanish"), modes=_BY_HAND, silences=True),
    Kind(name="the connection is cut", do=partial(_ordered, "cut"), modes=_BY_HAND, silences=True),
    Kind(name="the page babbles", do=partial(_ordered, "babble"), modes=_BY_HAND, silences=True),
    *(Kind(name=f"plans: {it}", do=partial(_absurd, it), undo=_sound, modes=PLANNING) for it in PLANS if it != "sound"),
    Kind(name="the digest of something else", do=_misnamed, undo=_sound, modes=_DECIDED),
    *(
        Kind(name=f"particles: {it}", do=partial(_found, it), undo=_true, says="Perception found")
        for it in FINDS
        if it != "true"
    ),
    Kind(name="cameras show nothing", do=partial(_shown, "nothing"), undo=_true, says="No view shows"),
    Kind(name="cameras show rope everywhere", do=partial(_shown, "rope everywhere"), undo=_true),
    Kind(name="cameras show nan", do=partial(_shown, "nan"), undo=_true, says="calibrate it again"),
    Kind(name="kill application", do=partial(_signalled, "application", _KILL), silences=True, ends=True),
    Kind(name="terminate application", do=partial(_signalled, "application", _TERMINATE), silences=True, ends=True),
    Kind(name="the disk is full", do=_filled, ends=True),
    Kind(name="kill arm", do=_arm_killed, ends=True),
    Kind(name="hang arm for good", do=_arm_lost, ends=True),
    Kind(name="kill cameras", do=partial(_waited, "cameras"), ends=True),
    Kind(name="kill world", do=partial(_waited, "world"), ends=True),
)


def kinds(mode: ModeName) -> tuple[Kind, ...]:
    """Faults that apply to this mode."""
    return tuple(kind for kind in KINDS if mode in kind.modes)


def in_turn(mode: ModeName) -> list[tuple[Kind, ...]]:
    """Groups of faults for one application each: all that it survives, and each that ends it."""
    survived = tuple(kind for kind in kinds(mode) if not kind.ends)
    return [survived, *((kind,) for kind in kinds(mode) if kind.ends)]
