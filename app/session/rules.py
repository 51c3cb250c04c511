"""Rules of a session: modes, stops, approval, edits, the checklist, and what is enough. Pure.

`reduce` alone decides; whoever holds the state publishes its commands, and gives up what the new state does not allow.
"""

from dataclasses import replace
from typing import Final

from app.core.dialogue.checklist import CheckItem, ChecklistRequest
from app.core.dialogue.control import EndRequest, Lease, ModeName, ModeRequest
from app.core.dialogue.requests import EditRequest, HandRequest
from app.core.messages import Decision, MessageId, Model, StopRequest
from app.session.state import (
    FUTILE_PLANS,
    PAUSE_S,
    UNATTENDED_S,
    Announce,
    AnnounceChecklist,
    AnnounceMode,
    AnnounceModel,
    ChosenModel,
    Event,
    Failure,
    HandRefusal,
    Inspection,
    Interruption,
    ModeChoice,
    ModelUpdate,
    MotionEnd,
    MotionsRequest,
    Observation,
    Offer,
    PauseEnd,
    PlanAssessment,
    Reconfiguration,
    Reduced,
    RequestedEnd,
    Resumption,
    SessionState,
    UnaskedMotion,
    Withdrawal,
)

MOST_MOTIONS: Final = 1000
"""Largest number of motions without approval that may be asked for."""
_EXHAUSTED: Final = "no motion promises to bring the object nearer to its goal"
_MOST_PAUSES: Final = 3
"""Most pauses in a row of an unattended run that goes on by itself."""
_BY_CAMERAS: Final = ("cameras", "calibration", "object")
"""Items of the checklist that a hand, which goes by a person's eyes, does not need."""


def reduce(state: SessionState, event: Event) -> Reduced:
    """The state after the event."""
    match event:
        case ModeChoice():
            return _on_mode_choice(state, event)
        case EndRequest():
            return Reduced(_leave_mode(replace(state, ended=True)))
        case Lease():
            return _on_lease(state, event)
        case StopRequest():
            return _stop_motion(replace(state, pressed=True), f"Stopped by {event.operator}.")
        case Decision():
            return _on_decision(state, event)
        case EditRequest():
            return _on_edit(state, event)
        case ChecklistRequest():
            return _on_confirmation(state, event)
        case Interruption():
            return _void(state, event.why)
        case Reconfiguration():
            return _void(replace(state, config=event.config), event.why)
        case ModelUpdate():
            return _on_model_update(state, event)
        case ChosenModel():
            return _on_chosen_model(state, event)
        case Offer():
            return Reduced(replace(state, pending=event.proposal, decision=None))
        case Withdrawal():
            late = (_not_shown(state.decision),) if state.decision and state.decision is not event.heeded else ()
            return Reduced(replace(state, pending=None, decision=None), late)
        case PlanAssessment():
            return _on_assessment(state, event)
        case Observation():
            return _on_observation(state, event)
        case UnaskedMotion():
            return _count_motion(state)
        case MotionsRequest():
            return _on_motions_request(state, event)
        case RequestedEnd():
            return _on_requested_end(state, event)
        case HandRequest():
            return _on_hand(state, event)
        case Failure():
            return _set_mode(state, "idle", "something failed; see the messages, then choose a mode")
        case HandRefusal():
            return _stop_motion(state, event.why)
        case MotionEnd():
            return _on_motion_end(state, event)
        case PauseEnd():
            return Reduced(replace(state, goes_on=False, pauses=state.pauses + 1))
        case Resumption():
            said = "The tool heeds the hand of {} now." if state.taken else "Resumed by {}."
            state = replace(state, stopped=False, resumed_s=event.now_s, tried=state.pressed, taken=None)
            return Reduced(state, (Announce("stop", said.format(event.operator)),))
        case Inspection():
            return _on_inspection(state, event.items)


# Modes: one that was asked for at a console lasts no longer than it is safe. Automatic ends with a stop, and when the
# operator who asked for it loses control; the one that the program began in ends with a request alone.


def _on_mode_choice(state: SessionState, event: ModeChoice) -> Reduced:
    request, state = event.request, replace(state, pushes_before=event.pushes)
    if request.mode == "automatic" and (refusal := _refusal(state, request)):
        return Reduced(state, (Announce("mode", refusal, (request.id,)),))
    why, same = f"asked for by {request.operator}", request.mode == state.mode != "automatic"
    state = replace(state, holder=request.operator)
    motions = request.motions if request.mode == "automatic" else 0
    if same:  # What is under way is what is wanted.
        return Reduced(replace(state, motions=motions, why=why), (AnnounceMode((request.id,)),))
    return _set_mode(state, request.mode, why, request.id, motions=motions)


def _refusal(state: SessionState, request: ModeRequest) -> str:
    """The reason why so many motions are not made automatically; empty where they are."""
    if state.automatic == "never":
        return "This arm is real: approve each motion, or start `dipac console` with --allow-automatic."
    if state.automatic == "confirmed" and not request.confirmed:
        return "This arm is real: confirm that its motions shall be made without approval."
    possible = 0 < request.motions <= MOST_MOTIONS
    return "" if possible else f"{request.motions} motions were asked for; automatic is for 1 to {MOST_MOTIONS}."


def _set_mode(state: SessionState, mode: ModeName, why: str, *cause: MessageId, motions: int = 0) -> Reduced:
    """Change to `mode`; what waits under the old one is given up."""
    if mode == "teleoperate" != state.mode:
        state = replace(state, before_hand=_mode_after_hand(state))
    return Reduced(_leave_mode(replace(state, mode=mode, why=why, motions=motions)), (AnnounceMode(cause),))


def _mode_after_hand(state: SessionState) -> ModeName:
    """The mode to go back to: not one in which motions are made without approval, unless the program began in it."""
    if _rests_after(state):
        return "idle"
    return "approve each" if state.mode == "automatic" and not state.config.automatic else state.mode


def _leave_mode(state: SessionState) -> SessionState:
    """Give up what waits, and a hand that has not taken over yet: its stop stays."""
    return _interrupt(replace(state, mode_changes=state.mode_changes + 1, taken=None), "was made in another mode")


def _void(state: SessionState, why: str) -> Reduced:
    """Make plans void; a session that was at rest before a motion was asked for rests again."""
    if not _rests_after(state):
        return Reduced(_interrupt(state, why))
    state, commands = _set_mode(state, "idle", "what was asked for is given up")
    return Reduced(replace(state, interrupted=why), commands)


def _rests_after(state: SessionState) -> bool:
    """True if the session was at rest before what is asked for."""
    return state.requested is not None and state.requested.resting


def _interrupt(state: SessionState, why: str) -> SessionState:
    return replace(state, interruptions=state.interruptions + 1, interrupted=why, requested=None)


def _on_lease(state: SessionState, lease: Lease) -> Reduced:
    """Take the mode, and the checklist before it is passed, from an operator who has lost control."""
    if any(operator != lease.holder for operator in state.confirmed.values()):
        state = replace(state, confirmed={}, by_hand=state.by_hand and state.passed)
    if state.mode not in ("automatic", "teleoperate") or state.holder in ("", lease.holder):
        return Reduced(state)
    back: ModeName = "idle" if state.mode == "teleoperate" else "approve each"
    return _set_mode(state, back, f"{state.holder} has no control any more", lease.id)


def _count_motion(state: SessionState) -> Reduced:
    """Count a motion without approval; the last one of a request ends the mode."""
    if state.mode != "automatic":
        return Reduced(state)
    left = max(state.motions - 1, 0)
    if left or not state.holder:
        return Reduced(replace(state, motions=left), (AnnounceMode(),))
    return _set_mode(state, "approve each", "the motions that were asked for are made")


def _leave_off(state: SessionState, why: str) -> Reduced:
    """Wait for requests in a session that stays; end any other."""
    if state.config.staying:
        return _set_mode(state, "idle", f"{why}; set another goal or choose a mode")
    return Reduced(_leave_mode(replace(state, ended=True)))


def _on_observation(state: SessionState, seen: Observation) -> Reduced:
    """Leave off where the goal is reached, the experiment concluded, or the pushes are made."""
    made = seen.pushes - state.pushes_before
    counted = state.config.staying and state.mode == "automatic"  # The mode itself counts these.
    if seen.concluded:
        return _leave_off(state, seen.concluded)
    if seen.reached:
        return _leave_off(state, "the goal is reached")
    if counted or seen.experiment or made < state.config.pushes:
        return Reduced(state)
    return _leave_off(state, f"{made} motions were made")


def _on_assessment(state: SessionState, event: PlanAssessment) -> Reduced:
    """Leave off after so many plans in a row that are no better than no motion."""
    if event.worth:
        return Reduced(replace(state, futile=0))
    # What was exhausted begins anew: somebody has chosen to go on.
    state = replace(state, futile=state.futile % FUTILE_PLANS + 1)
    said = "The best motion found is no better than none, by the model; it is not made."
    notice = Announce("plan", said, (event.proposal.id,))
    if not state.is_exhausted:
        return Reduced(state, (notice,))
    state, commands = _leave_off(state, _EXHAUSTED)
    return Reduced(state, (notice, *commands))


# Motions that an operator asks for: in the mode in which each is approved, to which a session goes from rest for them.


def _on_motions_request(state: SessionState, event: MotionsRequest) -> Reduced:
    requested = event.requested
    if state.mode not in ("idle", "approve each") or state.stopped:
        why = "A stop is in force: press Resume first." if state.stopped else "Choose 'Approve each' first."
        return Reduced(
            state, (Announce("motion", f"Nothing is offered for what you asked for. {why}", (event.cause,)),)
        )
    resting = state.mode == "idle" or _rests_after(state)
    if state.mode == "idle":
        state, commands = _set_mode(state, "approve each", f"{requested.operator} asked for a motion", event.cause)
    else:
        state, commands = _interrupt(state, "gives way to what was asked for"), ()
    return Reduced(replace(state, requested=requested._replace(resting=resting, asked=event.cause)), commands)


def _on_requested_end(state: SessionState, event: RequestedEnd) -> Reduced:
    """Go on with the next one; after the last one, or one that was not made, as before.

    What somebody asked for meanwhile is still to be made.
    """
    requested = state.requested
    if requested is None or requested.asked != event.asked:
        return Reduced(state)
    made, later = event.made, requested.demonstration[1:]
    if made and later:
        return Reduced(replace(state, requested=requested._replace(demonstration=later)))
    if not requested.resting:
        return Reduced(replace(state, requested=None))
    return _set_mode(state, "idle", "what was asked for is made" if made else "what was asked for is given up")


# The hand: it takes over from a motion that is made, and gives back to the mode before.


def _on_hand(state: SessionState, request: HandRequest) -> Reduced:
    if request.act == "give":
        if state.mode != "teleoperate":
            said = "The tool is not moved by hand; there is nothing to give back."
            return Reduced(state, (Announce("mode", said, (request.id,)),))
        mode, why = state.before_hand, f"{request.operator} gave it back"
        if mode == "automatic":  # The program began in it, on nobody's behalf.
            return _set_mode(replace(state, holder=""), mode, why, request.id, motions=state.config.pushes)
        return _set_mode(replace(state, holder=request.operator), mode, why, request.id)
    if state.stopped:
        said = "A stop is in force: press Resume, then choose 'By hand'."
        return Reduced(state, (Announce("mode", said, (request.id,)),))
    state, commands = _set_mode(state, "teleoperate", f"{request.operator} took over by hand", request.id)
    return Reduced(replace(state, holder=request.operator, stopped=True, goes_on=False, taken=request), commands)


# Models: version numbers of those in use only grow, whoever made them.


def _on_model_update(state: SessionState, event: ModelUpdate) -> Reduced:
    """Go on with what was learned, unless somebody chose another model meanwhile: it is not about that one."""
    if state.model is not event.replaces:
        return Reduced(state)
    return Reduced(replace(state, model=_numbered_model(state, event.model)), (AnnounceModel(),))


def _on_chosen_model(state: SessionState, event: ChosenModel) -> Reduced:
    """Plan with it, and for the goal as its cameras show it."""
    model, request = _numbered_model(state, event.model), event.request
    said = f"{request.operator} chose the model of {request.source}; it is version {model.version} now."
    state = replace(state, model=model, config=replace(state.config, shown_goal=event.shown_goal))
    notice = Announce("model", said + event.compiling, (request.id,))
    state, commands = _void(state, "is of another model")
    return Reduced(state, (*commands, notice, AnnounceModel()))


def _numbered_model(state: SessionState, model: Model) -> Model:
    """The model as the newest version; the first one keeps its number."""
    version = model.version if state.model is None else state.model.version + 1
    return model if model.version == version else replace(model, version=version)


# Stops: nothing moves from a stop until an operator resumes.


def _stop_motion(state: SessionState, why: str, *, goes_on: bool = False) -> Reduced:
    """Forbid motion until somebody resumes, and void the plan that is shown."""
    resting = _rests_after(state)
    goes_on = goes_on and state.config.automatic and state.pauses < _MOST_PAUSES
    state = replace(state, stopped=True, goes_on=goes_on, taken=None)
    state, commands = _interrupt(state, "was made before the stop; planning again"), ()
    if resting:
        state, commands = _set_mode(state, "idle", "the arm was stopped")
    elif state.mode == "automatic" and state.holder:
        state, commands = _set_mode(state, "approve each", "the arm was stopped")
    until = f" within {UNATTENDED_S:.0f} s" if state.config.automatic else ""
    onward = f"Press Resume in the console{until} to go on."
    if state.goes_on:
        onward = f"Nothing real moves, so the run goes on by itself in {PAUSE_S:.0f} s unless somebody presses STOP."
    return Reduced(state, (*commands, Announce("stop", f"{why.rstrip('.')}. {onward}")))


def _on_motion_end(state: SessionState, event: MotionEnd) -> Reduced:
    """Hold where the arm itself ended a motion before its time, whoever takes over from it."""
    executed = event.executed
    if executed.outcome == "completed":
        return Reduced(replace(state, pauses=0))
    if executed.time_s <= state.resumed_s:
        return Reduced(state)
    if state.taken is not None and executed.outcome == "stopped" and event.held:
        return Reduced(state, (Announce("arm", f"The motion ended where {state.taken.operator} took over."),))
    own = executed.outcome == "stopped" and not event.held
    return _stop_motion(state, executed.reason, goes_on=own and not state.stopped)


# Decisions and edits are about the plan that is shown, and no other.


def _on_decision(state: SessionState, decision: Decision) -> Reduced:
    waited_for = state.shown_plan(decision.proposal_id) is not None and state.decision is None
    if not waited_for or state.mode == "automatic":
        return Reduced(state, (_not_shown(decision),))
    return Reduced(replace(state, decision=decision))


def _not_shown(decision: Decision) -> Announce:
    return Announce("approval", f"{decision.proposal_id} is not the plan shown; nothing was done.")


def _on_edit(state: SessionState, request: EditRequest) -> Reduced:
    if state.requested is not None:
        return Reduced(state, (Announce("edit", "A motion that was asked for is made as it is, or not at all."),))
    if state.shown_plan(request.proposal_id) is not None:
        return Reduced(state)
    return Reduced(state, (Announce("edit", f"{request.proposal_id} is not the plan shown; edit the one that is."),))


# The checklist: an operator in control confirms all that a person can; the rest is what the program finds.


def _on_confirmation(state: SessionState, request: ChecklistRequest) -> Reduced:
    if state.passed:
        return Reduced(state)
    if request.key not in state.confirmable:
        return Reduced(state, (Announce("checklist", f"The checklist has no item {request.key!r}.", (request.id,)),))
    return Reduced(replace(state, confirmed={**state.confirmed, request.key: request.operator}))


def _on_inspection(state: SessionState, found: tuple[CheckItem, ...]) -> Reduced:
    untried = "now press Resume" if state.stopped else "press STOP in the bar above, and then Resume"
    stop = found_item("stop", "STOP works: it was pressed in this session, and lifted.", "" if state.tried else untried)
    items = (*found, stop, *(_personal(key, text, state) for key, text in state.confirmable.items()))
    # Once the tool could be jogged, it stays so: an arm that a hand moves does not rest.
    by_hand = state.by_hand or all(item.right for item in items if item.key not in _BY_CAMERAS)
    passed = all(item.right for item in items)
    changed, complete = items != state.items, passed and not state.passed
    said = (AnnounceChecklist(),) if changed else ()
    completed = (Announce("checklist", "The checklist is complete; motions may be approved."),) if complete else ()
    # What was passed stays so for the session.
    state = replace(state, items=items, by_hand=by_hand, passed=passed or state.passed)
    return Reduced(state, (*said, *completed))


def _personal(key: str, text: str, state: SessionState) -> CheckItem:
    operator = state.confirmed.get(key, "")
    said = f"confirmed by {operator}" if operator else ""
    return CheckItem(key=key, text=text, by="operator", right=bool(operator), said=said)


def found_item(key: str, text: str, wrong: str) -> CheckItem:
    """Item of the checklist that the program finds right, or `wrong` for this reason."""
    return CheckItem(key=key, text=text, by="program", right=not wrong, said=wrong)
