"""Messages of model monitoring: the verdict of an earlier discovery, and the change detection that runs after it."""

from dataclasses import dataclass
from typing import Literal, TypeAlias, final

from app.core.messages import Message

VerdictKind: TypeAlias = Literal["named", "set", "none", "none_of_these"]
"""Causes are named; they are alternatives that cannot be told apart; none is missing; something else is."""
WatchState: TypeAlias = Literal["learning", "right", "wrong"]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Watched(Message):
    """State of the change detection after a push (see `app.discovery.monitor`). `cause` holds the transition's id.

    `pushes`: pushes watched so far; `learning`: too few for a detection. `since`: the first push that the model seems
    to predict wrongly, 0 where it is right so far. `evidence` against the model, as a share of the alarm threshold; an
    alarm is false with probability `false_alarm` at most in a session. `error_m`: prediction error of this push;
    `moved_m`: predicted motion of the object; `promised_m`: prediction error that the model expects of itself, NaN
    where it gives none. `suspicions`: candidate causes, in words; `advice`: the command that finds the cause, if the
    session is recorded.
    """

    pushes: int
    state: WatchState
    since: int
    evidence: float
    false_alarm: float
    error_m: float
    moved_m: float
    promised_m: float
    suspicions: tuple[str, ...] = ()
    advice: str = ""


@final
@dataclass(frozen=True, kw_only=True)
class Blamed:
    """A cause that a discovery weighed: its name, its size with a 90 % interval in words, and its probability."""

    effect: str
    title: str
    family: str
    size: str
    probability: float


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Verdict(Message):
    """Result of `dipac discover`, as in its verdict.json. `source` is that file.

    `causes`: those of the verdict; `ranking`: all that were weighed, the most probable first. `next_push`: purpose of
    the push that would best separate the causes that remain, in words, empty where there is none. `promised_share`:
    error of the model in use on held-out episodes, as a share of the object's motion, NaN where unknown.
    """

    source: str
    kind: VerdictKind
    sentences: tuple[str, ...]
    causes: tuple[Blamed, ...]
    ranking: tuple[Blamed, ...]
    next_push: str = ""
    promised_share: float = float("nan")
