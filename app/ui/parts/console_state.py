"""State of the console: one frozen value, folded over the messages. Pure, so that it can be tested without a browser.

Folding is idempotent and tolerates echoes: the console notes its own STOP, Resume and decisions at once, and sees them
again when the program puts them on record.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, final

from app.core.colours import ColourRange
from app.core.dialogue.approval import Approved
from app.core.dialogue.camera_calibration_messages import BoardSeen, Placing
from app.core.dialogue.checklist import Checklist
from app.core.dialogue.control import Lease, Mode, ModeName
from app.core.dialogue.demonstration_messages import Take
from app.core.dialogue.model_monitor_messages import Verdict, Watched
from app.core.dialogue.object_messages import MeasuredObject
from app.core.dialogue.requests import EditRequest
from app.core.dialogue.segmentation_message import Seen
from app.core.messages import (
    ArmMode,
    ArmState,
    Decision,
    Episode,
    Executed,
    Fault,
    Frame,
    Goal,
    Health,
    Message,
    MessageId,
    Model,
    Notice,
    Outcome,
    Particles,
    Proposal,
    ResumeRequest,
    StopRequest,
    Transition,
)
from app.core.types import Points
from app.recording.format.records import ApprovalRecord

LOG_LENGTH = 8
EDITED = "edit"
"""Source name of a notice on an edited motion."""
_DECIDED_LENGTH = 64
_MODELS_LENGTH = 64
_COLOURS_LENGTH = 8


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Made:
    """An executed motion: the object before it, its predicted and its observed state after it."""

    before: Points
    expected: Points
    after: Points


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ConsoleState:
    """The latest of everything, and the short histories that the plots and the log show.

    `pending` is the proposal that may be decided on; `shown` is the one that is drawn, which stays to be compared with
    its result. `expected` is the predicted object after the last push, from its observation until the next push begins;
    `made` is the last motion with its result. `edit` is the edit of the pending proposal under way; `refusal` is the
    reason why the shown one was dropped, until there is another. `losses` holds (model version, one-step loss [m^2]);
    `models` the versions of this session, the newest last; `colours` the segmentation colours used, the current ones
    last; `board_seen` and `placing` are of a camera's calibration. In a `replay` nothing is decided.
    """

    episode: Episode | None = None
    frames: Mapping[str, Frame] = field(default_factory=dict[str, Frame])
    particles: Particles | None = None
    measured: MeasuredObject | None = None
    goal: Goal | None = None
    model: Model | None = None
    shown: Proposal | None = None
    pending: Proposal | None = None
    edit: EditRequest | None = None
    refusal: Notice | None = None
    executed: Executed | None = None
    expected: Points | None = None
    made: Made | None = None
    models: tuple[Model, ...] = ()
    seen: Seen | None = None
    colours: tuple[ColourRange, ...] = ()
    lease: Lease | None = None
    mode: Mode | None = None
    take: Take | None = None
    checklist: Checklist | None = None
    board_seen: BoardSeen | None = None
    placing: Placing | None = None
    watched: Watched | None = None
    verdict: Verdict | None = None
    arm: ArmState | None = None
    health: Health | None = None
    outcomes: tuple[Outcome, ...] = ()
    losses: tuple[tuple[int, float], ...] = ()
    log: tuple[Notice | Fault, ...] = ()
    fatal: Fault | None = None
    decided: tuple[MessageId, ...] = ()
    stop_s: float = -math.inf
    resume_s: float = -math.inf
    replay: bool = False

    @property
    def arm_mode(self) -> ArmMode | None:
        """The arm's mode from the newer of its two messages."""
        if self.health is None or (self.arm is not None and self.arm.time_s >= self.health.time_s):
            return self.arm.mode if self.arm else None
        return self.health.arm_mode

    @property
    def is_stopped(self) -> bool:
        """True while a STOP is in force: pressed here and not resumed, or in force at the arm."""
        return self.stop_s > self.resume_s or self.arm_mode in ("stopping", "stopped", "fault")

    @property
    def ahead(self) -> Points | None:
        """Predicted object after the shown push, until that has been observed."""
        predicted = self.shown.chosen.predicted if self.shown else None
        return None if predicted is self.expected else predicted

    @property
    def holder(self) -> str:
        """Operator in control; empty where there is none."""
        return self.lease.holder if self.lease else ""

    def open_to(self, operator: str) -> bool:
        """True where no other operator has control."""
        return self.holder in ("", operator)

    @property
    def mode_now(self) -> ModeName | Literal["fault"] | None:
        """Mode of operation; a fault overrides every mode. None before any message."""
        if self.fatal is not None or self.arm_mode == "fault":
            return "fault"
        return self.mode.mode if self.mode else None

    @property
    def is_teleoperated(self) -> bool:
        """True in the mode in which the tool is jogged."""
        return self.mode_now == "teleoperate"

    @property
    def demonstrating(self) -> bool:
        """True while a demonstration is being recorded."""
        return self.take is not None and self.take.state == "recording"

    @property
    def is_cleared(self) -> bool:
        """True where no open checklist forbids motions."""
        return self.checklist is None or self.checklist.passed

    @property
    def cleared_by_hand(self) -> bool:
        """True where no open checklist forbids jogging."""
        return self.checklist is None or self.checklist.passed or self.checklist.by_hand

    @property
    def decidable(self) -> bool:
        """True where a decision on the pending proposal would have an effect now."""
        asked = self.is_cleared and (self.mode is None or self.mode.mode == "approve each")
        return self.pending is not None and asked and not self.is_stopped and self.fatal is None and not self.replay

    def after(self, message: Message) -> "ConsoleState":
        """The state after `message`."""
        match message:
            case Frame():
                return replace(self, frames={**self.frames, message.camera.name: message})
            case Particles():
                return replace(self, particles=message)
            case Goal():
                return replace(self, goal=message)
            case ArmState():
                return replace(self, arm=message)
            case Health():
                return replace(self, health=message)
            case Episode():
                fresh = ConsoleState(episode=message, stop_s=self.stop_s, resume_s=self.resume_s, lease=self.lease)
                return replace(fresh, replay=self.replay)
            case Model():
                known = () if math.isnan(message.loss_m2) else ((message.version, message.loss_m2),)
                models = (*(model for model in self.models if model.version != message.version), message)
                return replace(self, model=message, losses=self.losses + known, models=models[-_MODELS_LENGTH:])
            case Outcome():
                return replace(self, outcomes=(*self.outcomes, message))
            case Proposal():
                return self if message.id in self.decided else self._showing(message)
            case Executed():
                return replace(self, executed=message, pending=None, edit=None)
            case Approved() | ApprovalRecord():
                return replace(self, expected=None)
            case Transition():
                return self._with_result(message)
            case EditRequest():
                up = self.pending is not None and self.pending.id == message.proposal_id
                return replace(self, edit=message) if up else self
            case Seen():
                return self._looking(message)
            case Watched():
                return replace(self, watched=message)
            case Verdict():
                return replace(self, verdict=message)
            case Decision():
                return self._without(message.proposal_id)
            case StopRequest():
                return replace(self, stop_s=max(self.stop_s, message.time_s))
            case ResumeRequest():
                return replace(self, resume_s=max(self.resume_s, message.time_s))
            case Lease():
                # The echo of a superseded one restores nothing.
                older = self.lease is not None and message.time_s < self.lease.time_s
                return self if older else replace(self, lease=message)
            case Mode():
                return replace(self, mode=message)
            case Take():
                return replace(self, take=message)
            case MeasuredObject():
                return replace(self, measured=message)
            case Checklist():
                return replace(self, checklist=message)
            case BoardSeen():
                return replace(self, board_seen=message)
            case Placing():
                return replace(self, placing=message)
            case Notice() | Fault():
                return self._with_log_entry(message)
            case _:
                return self

    def _showing(self, proposal: Proposal) -> "ConsoleState":
        """The state with that proposal open to decision."""
        return replace(self, shown=proposal, pending=proposal, edit=None, refusal=None)

    def _with_result(self, message: Transition) -> "ConsoleState":
        """The state with the result of the last motion. A jogged one has no prediction: it was not approved."""
        expected = self.shown.chosen.predicted if self.shown and message.executed.cause else None
        if expected is None:
            return replace(self, expected=None, made=None)
        made = Made(before=message.before, expected=expected, after=message.after)
        return replace(self, expected=expected, made=made)

    def _looking(self, message: Seen) -> "ConsoleState":
        """The state with a new segmentation, and its colours where they differ from the last ones."""
        colour = ColourRange.of(message.hue_deg, message.saturation, message.value)
        new = (colour,) if self.colours[-1:] != (colour,) else ()
        return replace(self, seen=message, colours=(*self.colours, *new)[-_COLOURS_LENGTH:])

    def _without(self, proposal_id: MessageId) -> "ConsoleState":
        """The state with that proposal closed to decision."""
        decided = (*self.decided, proposal_id)[-_DECIDED_LENGTH:]
        if self.pending is None or self.pending.id != proposal_id:
            return replace(self, decided=decided)
        return replace(self, decided=decided, pending=None, edit=None)

    def _with_log_entry(self, message: Notice | Fault) -> "ConsoleState":
        """The state with the message in the log; one that names the pending proposal as its cause withdraws it."""
        edit = None if message.where == EDITED else self.edit
        state = replace(self, log=(*self.log, message)[-LOG_LENGTH:], edit=edit)
        if isinstance(message, Notice) and self.shown is not None and self.shown.id in message.cause:
            state = replace(state, refusal=message)
        if state.pending is not None and state.pending.id in message.cause:
            state = state._without(state.pending.id)
        return replace(state, fatal=message) if isinstance(message, Fault) and message.fatal else state
