"""Messages about a model that may be wrong: what a discovery concluded before, and what the watch says meanwhile."""

from dataclasses import dataclass
from typing import Literal, TypeAlias, final

from app.core.messages import Message

WatchState: TypeAlias = Literal["learning", "right", "wrong"]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Watched(Message):
    """Whether the model is still right, after a push (`app.discovery.watch`). `cause` holds the transition's id.

    `pushes`: how many were watched; `learning`: too few for anything to be noticed. `since`: the first push that the
    model seems to get wrong, 0 where it is right so far. `evidence` against it, as a share of what it takes for an
    alarm, which is false with probability `false_alarm` at most in a session. `error_m`: how far off the push was
    predicted; `moved_m`: how far the object was to move; `promised_m`: the error that the model said it would make, NaN
    where it said nothing. `suspicions`: what may be wrong, in words; `advice`: the command that finds it out, if the
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
    """A cause that a discovery weighed: what it is called, its size with a 90 % interval in words, its probability."""

    effect: str
    title: str
    family: str
    size: str
    probability: float


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Verdict(Message):
    """What `dipac discover` concluded, as its verdict.json says it. `source` is that file.

    `causes`: those of the verdict; `ranking`: all that were weighed, the likeliest first. `next_push`: what the push
    that would best tell apart what is left is for, in words, empty where there is none. `promised_share`: the share of
    the object's motion by which the model in use erred on episodes that it was not fitted to, NaN where unknown.
    """

    source: str
    kind: Literal["named", "set", "none", "none_of_these"]
    sentences: tuple[str, ...]
    causes: tuple[Blamed, ...]
    ranking: tuple[Blamed, ...]
    next_push: str = ""
    promised_share: float = float("nan")
