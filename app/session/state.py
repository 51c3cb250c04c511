"""State of a session, the events that change it, and the commands that follow; `rules.py` says how."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple, TypeAlias, final

from app.core.dialogue.checklist import CheckItem, ChecklistRequest
from app.core.dialogue.control import EndRequest, Lease, ModeName, ModeRequest
from app.core.dialogue.requests import EditRequest, HandRequest, ModelRequest
from app.core.messages import Decision, Executed, MessageId, Model, Proposal, StopRequest, Transition
from app.core.types import Points
from app.tasks.elements.base import EpisodeConfig

Automatic: TypeAlias = Literal["freely", "confirmed", "never"]
"""Policy for unattended motion: allowed on request, after confirmation, or never."""
UNATTENDED_S: Final = 120.0
"""Timeout of a run with automatic approval for a resume after a stop."""
FUTILE_PLANS: Final = 2
"""Plans in a row, each with other random branches, that end a run if they are no better than no motion."""
PAUSE_S: Final = 5.0
"""Pause before such a run goes on by itself if only the arm's own process stopped it."""


@final
class RequestedMotions(NamedTuple):
    """Motions that an operator asked for, and no planner chose; each is shown, approved and checked like any other.

    `demonstration`: those of one that are still to be made, the next one first; empty for the way to the start pose.
    `resting`: the session was idle, and is so again afterwards. `asked`: id of the request.
    """

    operator: str
    demonstration: tuple[Transition, ...] = ()
    resting: bool = False
    asked: MessageId = MessageId("")


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class SessionState:
    """All that the rules depend on.

    `model`: the one in use; None until the planner's process has said the first.
    `mode` was asked for by `holder`, by nobody if the program began in it; `mode_changes` counts its ends.
    `interruptions` counts the times that plans became void, the last time because the plan `interrupted`.
    `pending`: the plan that a decision is waited for; `decision`: the first one on it. `pushes_before`: pushes made
    before the present mode was asked for. `futile`: plans in a row that were no better than no motion.

    `requested`: what is offered before any plan; whatever makes plans void ends it. `before_hand`: the mode to go back
    to from moving by hand; `taken`: the request of whoever takes over from a motion, until the arm heeds the hand.

    `stopped`: nothing moves until somebody resumes; `tried`: STOP was `pressed` in this session, and lifted.
    A run without an operator is unattended: after a stop that nobody pressed, most often of a computer that is too
    busy, it `goes_on` by itself after a pause, but not after so many `pauses` in a row. Nothing real moves in it.

    `confirmable`: items of the checklist that a person confirms, by key; `confirmed`: the operators who did. Nothing
    moves before it is `passed`; the tool may be jogged before that, `by_hand`, until control changes hands.
    """

    config: EpisodeConfig
    automatic: Automatic
    model: Model | None = None

    mode: ModeName
    motions: int
    why: str = ""
    holder: str = ""
    mode_changes: int = 0
    ended: bool = False

    interruptions: int = 0
    interrupted: str = ""
    pending: Proposal | None = None
    decision: Decision | None = None
    pushes_before: int = 0
    futile: int = 0

    requested: RequestedMotions | None = None
    before_hand: ModeName = "idle"
    taken: HandRequest | None = None

    stopped: bool = False
    resumed_s: float
    pressed: bool = False
    tried: bool = False
    goes_on: bool = False
    pauses: int = 0

    confirmable: Mapping[str, str] = field(default_factory=dict[str, str])
    confirmed: Mapping[str, str] = field(default_factory=dict[str, str])
    items: tuple[CheckItem, ...] = ()
    passed: bool = False
    by_hand: bool = False

    @property
    def model_in_use(self) -> Model:
        """The model in use, once there is one: nothing is planned or learned before."""
        assert self.model is not None, "the planner's process has said one"
        return self.model

    def shown_plan(self, proposal_id: MessageId) -> Proposal | None:
        """The plan of this id, if it is the one that a decision is waited for."""
        return self.pending if self.pending is not None and self.pending.id == proposal_id else None

    @property
    def is_exhausted(self) -> bool:
        """True after so many plans in a row that were no better than no motion."""
        return self.futile >= FUTILE_PLANS

    @property
    def patience_s(self) -> float | None:
        """Timeout of a stop [s]; None: it is waited for ever."""
        if not self.config.automatic:
            return None
        return PAUSE_S if self.goes_on else UNATTENDED_S

    @property
    def blocked_reason(self) -> str:
        """The reason why nothing moves yet, as text; empty if motion is permitted."""
        if self.passed:
            return ""
        open_items = "; ".join(item.text.rstrip(".") for item in self.items if not item.right)
        return f"Nothing moves before the checklist is complete. Still open: {open_items or 'all of it'}."


@final
class Interruption(NamedTuple):
    """Plans have become void; `why` completes "the plan ..."."""

    why: str


@final
class Reconfiguration(NamedTuple):
    """Another goal is planned for, or with another model; `why` as above."""

    config: EpisodeConfig
    why: str


@final
class ModelUpdate(NamedTuple):
    """A model was learned, and replaces the one that it continues; the first one of a session replaces none."""

    model: Model
    replaces: Model | None


@final
class ChosenModel(NamedTuple):
    """The model that an operator asks for is sound.

    `shown_goal` (M, 3) [m]: the goal as its cameras show it, None if they do not err; `compiling`: a sentence on what
    the planner compiles for it, empty if nothing.
    """

    request: ModelRequest
    model: Model
    shown_goal: Points | None
    compiling: str


@final
class Offer(NamedTuple):
    """A plan is shown, and a decision on it is waited for."""

    proposal: Proposal


@final
class Withdrawal(NamedTuple):
    """No decision is waited for any more; `heeded`: the one that ended it."""

    heeded: Decision | None


@final
class PlanAssessment(NamedTuple):
    """A plan in automatic mode is worth making, or it is no better than no motion."""

    proposal: Proposal
    worth: bool


@final
class Observation(NamedTuple):
    """The object was seen, at its goal or not. `experiment`: pushes are chosen for what they say, or why no more are.

    `pushes`: those made in the session.
    """

    reached: bool
    pushes: int
    experiment: bool
    concluded: str


@final
class UnaskedMotion(NamedTuple):
    """A motion without approval was made."""


@final
class MotionsRequest(NamedTuple):
    """Motions are asked for, and can be made from here; `cause`: the operator's request."""

    requested: RequestedMotions
    cause: MessageId


@final
class RequestedEnd(NamedTuple):
    """The motion that was due of the request `asked` is over: made to its end, or given up."""

    made: bool
    asked: MessageId


@final
class Failure(NamedTuple):
    """A turn failed in a session that goes on."""


@final
class HandRefusal(NamedTuple):
    """The arm refuses to be moved by hand."""

    why: str


@final
class MotionEnd(NamedTuple):
    """A motion has ended; `held`: a stop of this program, and not of the arm's own process, is in force."""

    executed: Executed
    held: bool


@final
class PauseEnd(NamedTuple):
    """An unattended run has paused for long enough."""


@final
class Resumption(NamedTuple):
    """The arm has lifted its stop."""

    operator: str
    now_s: float


@final
class Inspection(NamedTuple):
    """Items of the checklist as the program found them."""

    items: tuple[CheckItem, ...]


@final
class ModeChoice(NamedTuple):
    """A mode is asked for, after so many pushes."""

    request: ModeRequest
    pushes: int


Event: TypeAlias = (
    ModeChoice
    | EndRequest
    | Lease
    | StopRequest
    | Decision
    | EditRequest
    | ChecklistRequest
    | Interruption
    | Reconfiguration
    | ModelUpdate
    | ChosenModel
    | Offer
    | Withdrawal
    | PlanAssessment
    | Observation
    | UnaskedMotion
    | MotionsRequest
    | RequestedEnd
    | Failure
    | HandRequest
    | HandRefusal
    | MotionEnd
    | PauseEnd
    | Resumption
    | Inspection
)


@final
class Announce(NamedTuple):
    """Command to publish a notice `about` messages; a plan among them is withdrawn by it."""

    where: str
    text: str
    about: tuple[MessageId, ...] = ()


@final
class AnnounceMode(NamedTuple):
    """Command to publish the mode."""

    cause: tuple[MessageId, ...] = ()


@final
class AnnounceModel(NamedTuple):
    """Command to publish the model in use."""


@final
class AnnounceChecklist(NamedTuple):
    """Command to publish the checklist."""


Command: TypeAlias = Announce | AnnounceMode | AnnounceModel | AnnounceChecklist


@final
class Reduced(NamedTuple):
    """The next state, and what to announce, in order."""

    state: SessionState
    commands: tuple[Command, ...] = ()
