"""Rules of a session, each tested on the state alone: no loop, no arm, no camera."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.core.dialogue.checklist import ChecklistRequest
from app.core.dialogue.control import EndRequest, Lease, ModeName, ModeRequest
from app.core.dialogue.requests import EditRequest, HandRequest, ModelRequest
from app.core.messages import Decision, Goal, Model, StopRequest, fresh_id
from app.session.rules import found_item, reduce
from app.session.state import (
    Announce,
    AnnounceChecklist,
    AnnounceMode,
    AnnounceModel,
    Automatic,
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
    RequestedMotions,
    Resumption,
    SessionState,
    UnaskedMotion,
    Withdrawal,
)
from tests.session.cell import small_wish
from tests.ui import synthetic

PLAN, OTHER = (synthetic.proposal(synthetic.rope(0.5), branches=1) for _ in range(2))
PERSONAL = {"clear": "Nobody is near."}


def state(*, automatic: bool = False, staying: bool = False, pushes: int = 5, **fields: Any) -> SessionState:
    """State of a session with a person, or of an automatic run."""
    defaults = {"automatic": "freely", "mode": "automatic" if automatic else "approve each", "motions": pushes}
    config = small_wish(automatic=automatic, staying=staying, pushes=pushes)
    return SessionState(
        **({"config": config, "resumed_s": 10.0, "confirmable": PERSONAL, "passed": True} | defaults | fields)
    )


def after(begin: SessionState, *events: Event) -> Reduced:
    """State after all events, and the commands of the last."""
    reduced = Reduced(begin)
    for event in events:
        reduced = reduce(reduced.state, event)
    return reduced


def chosen(mode: ModeName, motions: int = 0, *, pushes: int = 0, confirmed: bool = False) -> ModeChoice:
    named = {"id": fresh_id("mode"), "time_s": 0.0, "operator": "ann"}
    return ModeChoice(ModeRequest(**named, mode=mode, motions=motions, confirmed=confirmed), pushes)


def lease(holder: str) -> Lease:
    return Lease(id=fresh_id("lease"), time_s=0.0, holder=holder, why="")


def stop() -> StopRequest:
    return StopRequest(id=fresh_id("stop"), time_s=0.0, operator="ann")


def decision(of: str = PLAN.id) -> Decision:
    return Decision(
        id=fresh_id("decision"), time_s=0.0, proposal_id=of, digest="", approve=True, operator="ann", reason=""
    )


def motion_end(outcome: Any, *, at_s: float = 20.0, held: bool = False) -> MotionEnd:
    made = synthetic.executed(np.zeros((3, 3)))
    return MotionEnd(replace(made, outcome=outcome, time_s=at_s, reason="It tripped."), held)


def texts(reduced: Reduced) -> list[str]:
    return [command.text for command in reduced.commands if isinstance(command, Announce)]


# Modes


@pytest.mark.parametrize("mode", ["idle", "teleoperate", "plan only"])
def test_another_mode_voids_plans_and_is_said_with_who_asked_for_it(mode: ModeName) -> None:
    event = chosen(mode)
    (new, commands) = after(state(), event)
    assert (new.mode, new.holder, new.why, new.motions) == (mode, "ann", "asked for by ann", 0)
    assert (new.interruptions, new.mode_changes, new.interrupted) == (1, 1, "was made in another mode")
    assert commands == (AnnounceMode((event.request.id,)),)


def test_the_mode_that_is_under_way_interrupts_nothing_but_is_another_operators() -> None:
    new, commands = after(state(holder="bob"), chosen("approve each"))
    assert (new.holder, new.interruptions, new.mode_changes, len(commands)) == ("ann", 0, 0, 1)


def test_automatic_that_is_asked_for_again_counts_anew() -> None:
    new, _ = after(state(), chosen("automatic", 3), UnaskedMotion(), chosen("automatic", 3))
    assert (new.motions, new.mode_changes) == (3, 2)


@pytest.mark.parametrize(
    ("policy", "motions", "confirmed", "says"),
    [
        ("freely", 1, False, ""),
        ("freely", 1000, False, ""),
        ("freely", 0, False, "automatic is for 1 to 1000"),
        ("freely", 1001, False, "automatic is for 1 to 1000"),
        ("confirmed", 1, True, ""),
        ("confirmed", 1, False, "confirm that its motions"),
        ("confirmed", 0, True, "automatic is for 1 to 1000"),
        ("never", 1, True, "--allow-automatic"),
    ],
)
def test_motions_are_made_without_approval_where_that_may_be(
    policy: Automatic, motions: int, confirmed: bool, says: str
) -> None:
    begin, asked = replace(state(), automatic=policy), chosen("automatic", motions, confirmed=confirmed)
    reduced = after(begin, asked)
    assert (reduced.state.mode == "automatic") == (not says)
    assert all(says in text for text in texts(reduced))
    assert bool(texts(reduced)) == bool(says)


def test_the_motions_of_a_request_are_counted_and_end_it() -> None:
    counted = [after(state(), chosen("automatic", 3), *[UnaskedMotion()] * made).state for made in range(5)]
    assert [(each.mode, each.motions) for each in counted] == [
        ("automatic", 3),
        ("automatic", 2),
        ("automatic", 1),
        ("approve each", 0),
        ("approve each", 0),
    ]
    assert counted[3].why == "the motions that were asked for are made"
    assert counted[3].mode_changes == counted[4].mode_changes == 2


def test_a_run_that_began_automatic_is_ended_by_no_count() -> None:
    new, _ = after(state(automatic=True, pushes=1), UnaskedMotion(), UnaskedMotion())
    assert (new.mode, new.motions, new.mode_changes) == ("automatic", 0, 0)


@pytest.mark.parametrize(
    ("mode", "becomes"),
    [("automatic", "approve each"), ("teleoperate", "idle"), ("plan only", "plan only"), ("idle", "idle")],
)
@pytest.mark.parametrize("holder", ["ann", "bob", ""])
def test_what_nobody_watches_ends_with_control(mode: ModeName, becomes: ModeName, holder: str) -> None:
    new, commands = after(state(), chosen(mode, 5), lease(holder))
    assert new.mode == (mode if holder == "ann" else becomes)
    assert len(commands) == (new.mode != mode)


def test_a_mode_that_nobody_asked_for_does_not_end_with_control() -> None:
    assert after(state(automatic=True), lease("bob")).state.mode == "automatic"


def test_what_fails_leads_to_idle() -> None:
    new, _ = after(state(staying=True), Failure())
    assert (new.mode, new.mode_changes, new.ended) == ("idle", 1, False)


def test_the_end_voids_everything_and_says_nothing() -> None:
    new, commands = after(state(), EndRequest(id=fresh_id("end"), time_s=0.0, operator="ann"))
    assert (new.ended, new.interruptions, new.mode_changes, commands) == (True, 1, 1, ())


# What is enough


@pytest.mark.parametrize(
    ("seen", "why"),
    [
        (Observation(False, 1, False, ""), ""),
        (Observation(True, 0, False, ""), "the goal is reached"),
        (Observation(False, 2, False, ""), "2 motions were made"),
        (Observation(False, 2, True, ""), ""),
        (Observation(True, 2, False, "Enough is known."), "Enough is known."),
    ],
)
def test_it_leaves_off_at_the_goal_after_its_pushes_or_an_experiment(seen: Observation, why: str) -> None:
    stays = after(state(staying=True, pushes=2), seen).state
    assert (stays.mode, stays.ended) == ("idle" if why else "approve each", False)
    assert stays.why == (f"{why}; set another goal or choose a mode" if why else "")
    assert after(state(pushes=2), seen).state.ended == bool(why)


def test_pushes_are_counted_from_the_last_choice_of_a_mode() -> None:
    again = after(state(staying=True, pushes=2), chosen("approve each", pushes=7)).state
    assert after(again, Observation(False, 8, False, "")).state.mode == "approve each"
    assert after(again, Observation(False, 9, False, "")).state.mode == "idle"


def test_automatic_of_a_session_that_stays_counts_its_own_motions() -> None:
    automatic = after(state(staying=True, pushes=2), chosen("automatic", 9)).state
    assert after(automatic, Observation(False, 5, False, "")).state.mode == "automatic"


@pytest.mark.parametrize("staying", [True, False])
def test_two_plans_in_a_row_that_are_no_better_than_none_end_it_and_then_it_begins_anew(staying: bool) -> None:
    bad, good = PlanAssessment(PLAN, worth=False), PlanAssessment(PLAN, worth=True)
    begin = state(automatic=True, staying=staying)
    assert [after(begin, *[bad] * count).state.futile for count in range(5)] == [0, 1, 2, 1, 2]
    assert after(begin, bad, good, bad).state.futile == 1
    assert not after(begin, bad).state.mode_changes
    end = after(begin, bad, bad)
    assert (end.state.ended, end.state.mode) == (not staying, "idle" if staying else "automatic")
    assert end.commands[0] == Announce(
        "plan", "The best motion found is no better than none, by the model; it is not made.", (PLAN.id,)
    )


# Stops


def test_a_stop_voids_plans_and_holds_until_somebody_resumes() -> None:
    held = after(state(), stop())
    assert held.state.stopped
    assert (held.state.interruptions, held.state.interrupted) == (1, "was made before the stop; planning again")
    assert texts(held) == ["Stopped by ann. Press Resume in the console to go on."]
    assert held.state.patience_s is None
    resumed = after(held.state, Resumption("bob", 33.0))
    assert (resumed.state.stopped, resumed.state.resumed_s) == (False, 33.0)
    assert texts(resumed) == ["Resumed by bob."]


def test_a_stop_ends_automatic_that_somebody_asked_for_and_no_other() -> None:
    asked = after(state(), chosen("automatic", 5), stop())
    assert (asked.state.mode, asked.state.why) == ("approve each", "the arm was stopped")
    assert [type(command) for command in asked.commands] == [AnnounceMode, Announce]
    assert after(state(automatic=True), stop()).state.mode == "automatic"
    assert after(state(), chosen("teleoperate"), stop()).state.mode == "teleoperate"


def test_a_hand_that_the_arm_refuses_is_held() -> None:
    held = after(state(), HandRefusal("A stop is in force."))
    assert held.state.stopped
    assert texts(held) == ["A stop is in force. Press Resume in the console to go on."]


@pytest.mark.parametrize(
    ("end", "stopped"),
    [
        (motion_end("completed"), False),
        (motion_end("stopped"), True),
        (motion_end("stopped", at_s=9.0), False),
        (motion_end("fault"), True),
    ],
)
def test_a_motion_that_ended_before_its_time_holds_unless_somebody_resumed_since(end: MotionEnd, stopped: bool) -> None:
    assert after(state(), end).state.stopped == stopped


def test_only_a_stop_that_was_pressed_and_lifted_was_tried() -> None:
    resumed = Resumption("ann", 30.0)
    assert not after(state(), stop()).state.tried
    assert after(state(), stop(), resumed).state.tried
    assert not after(state(), motion_end("stopped"), resumed).state.tried


def test_an_unattended_run_goes_on_by_itself_after_a_stop_of_the_arm_alone() -> None:
    own = motion_end("stopped")
    paused = after(state(automatic=True), own)
    assert (paused.state.goes_on, paused.state.patience_s) == (True, 5.0)
    assert "goes on by itself in 5 s" in texts(paused)[0]
    for begin, *events in (
        [state(automatic=True), stop()],
        [state(automatic=True), own, stop()],
        [state(automatic=True), stop(), own],
        [state(automatic=True), motion_end("stopped", held=True)],
        [state(automatic=True), motion_end("fault")],
        [state(automatic=True), own, PauseEnd()],
    ):
        waits = after(begin, *events).state
        assert (waits.stopped, waits.goes_on, waits.patience_s) == (True, False, 120.0)
    assert not after(state(), own).state.goes_on


def test_it_pauses_three_times_in_a_row_and_no_more_until_a_motion_is_completed() -> None:
    own, again = motion_end("stopped"), (PauseEnd(), Resumption("the run", 11.0))
    thrice = after(state(automatic=True), *(own, *again) * 3).state
    assert not after(thrice, own).state.goes_on
    anew = after(thrice, motion_end("completed"))
    assert [after(anew.state, *(own, *again) * count, own).state.goes_on for count in range(4)] == [True] * 3 + [False]


# Plans, decisions and edits


def test_a_decision_counts_once_for_the_plan_that_is_waited_for() -> None:
    first, second = decision(), decision()
    waiting = after(state(), Offer(PLAN)).state
    heard = after(waiting, first)
    assert (heard.state.decision, heard.commands) == (first, ())
    late = after(heard.state, second)
    assert late.state.decision is first
    assert texts(late) == [f"{PLAN.id} is not the plan shown; nothing was done."]
    assert after(heard.state, Withdrawal(first)).commands == ()
    for begin in (state(), after(waiting, Withdrawal(None)).state, after(state(), Offer(OTHER)).state):
        assert after(begin, decision()).state.decision is None
        assert texts(after(begin, decision())) == [f"{PLAN.id} is not the plan shown; nothing was done."]


def test_where_it_is_automatic_no_decision_of_a_person_counts() -> None:
    assert after(state(automatic=True), Offer(PLAN), decision()).state.decision is None


def test_a_decision_that_came_too_late_is_answered() -> None:
    assert texts(after(state(), Offer(PLAN), decision(), Withdrawal(None))) == [
        f"{PLAN.id} is not the plan shown; nothing was done."
    ]


@pytest.mark.parametrize(("events", "refused"), [([], True), ([Offer(OTHER)], True), ([Offer(PLAN)], False)])
def test_a_change_is_of_the_plan_that_is_shown(events: list[Event], refused: bool) -> None:
    ends = np.zeros(3), np.ones(3)
    edit = EditRequest(id=fresh_id("edit"), time_s=0.0, operator="ann", proposal_id=PLAN.id, start=ends[0], end=ends[1])
    said = texts(after(state(), *events, edit))
    assert said == ([f"{PLAN.id} is not the plan shown; edit the one that is."] if refused else [])


def test_another_goal_or_model_voids_plans_with_its_reason() -> None:
    config = replace(small_wish(), goal=Goal(id=fresh_id("goal"), time_s=0.0, positions=synthetic.rope(0.1)))
    new, commands = after(state(), Reconfiguration(config, "is for another goal"))
    assert (new.config, new.interruptions, new.interrupted, commands) == (config, 1, "is for another goal", ())
    assert after(state(), Interruption("is offered as you changed it")).state.mode_changes == 0


# Models


def model(version: int) -> Model:
    return replace(small_wish().model, id=fresh_id("model"), version=version)


def choice(chosen: Model) -> ChosenModel:
    """An operator's choice of an earlier model, whose cameras err."""
    request = ModelRequest(id=fresh_id("model"), time_s=0.0, operator="ann", model=chosen, source="version 1")
    return ChosenModel(request, chosen, synthetic.rope(0.2), " It takes a while.")


def test_the_first_model_keeps_its_number_and_numbers_only_grow_from_it() -> None:
    first, learned = model(4), model(5)
    begun = after(state(), ModelUpdate(first, replaces=None))
    assert (begun.state.model, begun.commands) == (first, (AnnounceModel(),))
    new, commands = after(begun.state, ModelUpdate(learned, replaces=first))
    assert (new.model, new.interruptions, commands) == (learned, 0, (AnnounceModel(),))
    new = after(new, choice(model(2))).state
    assert new.model_in_use.version == 6
    assert after(new, ModelUpdate(model(5), replaces=new.model)).state.model_in_use.version == 7


def test_what_is_learned_from_a_model_that_is_not_in_use_any_more_is_dropped() -> None:
    first = model(0)
    chosen = after(state(), ModelUpdate(first, replaces=None), choice(model(0))).state
    for late in (ModelUpdate(model(1), replaces=first), ModelUpdate(model(0), replaces=None)):
        new, commands = after(chosen, late)
        assert (new.model, commands) == (chosen.model, ())


def test_a_model_that_an_operator_chose_voids_plans_and_moves_the_goal_that_is_shown() -> None:
    event = choice(model(1))
    new, (notice, announced) = after(state(model=model(6)), event)
    said = "ann chose the model of version 1; it is version 7 now. It takes a while."
    assert (notice, announced) == (Announce("model", said, (event.request.id,)), AnnounceModel())
    assert new.model_in_use.id == event.model.id
    assert (new.interruptions, new.interrupted) == (1, "is of another model")
    np.testing.assert_array_equal(new.config.target, synthetic.rope(0.2))


# The checklist


def found(**wrong: str) -> Inspection:
    """Inspection of two items, which are right but for the reasons given."""
    keys = ("arm", "cameras")
    return Inspection(tuple(found_item(key, key, wrong.get(key, "")) for key in keys))


def confirms(key: str, by: str = "ann") -> ChecklistRequest:
    return ChecklistRequest(id=fresh_id("checklist"), time_s=0.0, operator=by, key=key)


CLOSED = state(passed=False)
TRIED = (stop(), Resumption("ann", 11.0))


@pytest.mark.parametrize(
    ("events", "wrong", "by_hand"),
    [
        ([], {"stop", "clear"}, False),
        ([confirms("clear")], {"stop"}, False),
        ([*TRIED], {"clear"}, False),
        ([*TRIED, confirms("clear")], set[str](), True),
        ([*TRIED, confirms("clear"), stop()], set[str](), True),
        ([confirms("clear"), confirms("clear", "bob"), *TRIED, lease("bob")], set[str](), True),
        ([confirms("clear"), *TRIED, lease("bob")], {"clear"}, False),
        ([confirms("clear"), *TRIED, lease("ann")], set[str](), True),
    ],
)
def test_it_is_complete_once_every_item_is_right(events: list[Event], wrong: set[str], by_hand: bool) -> None:
    new, commands = after(CLOSED, *events, found())
    assert {item.key for item in new.items if not item.right} == wrong
    assert (new.passed, new.by_hand) == (not wrong, by_hand)
    assert bool(new.blocked_reason) == bool(wrong)
    assert AnnounceChecklist() in commands
    assert (Announce("checklist", "The checklist is complete; motions may be approved.") in commands) == new.passed


def test_a_hand_needs_nothing_of_what_the_cameras_say_and_keeps_the_tool_until_control_changes_hands() -> None:
    by_hand = after(CLOSED, confirms("clear"), *TRIED, found(cameras="nothing new")).state
    assert (by_hand.passed, by_hand.by_hand) == (False, True)
    moving = after(by_hand, found(arm="it is moving", cameras="nothing new")).state
    assert (moving.passed, moving.by_hand) == (False, True)
    assert not after(moving, lease("bob")).state.by_hand


def test_what_is_passed_stays_so_and_is_said_once() -> None:
    passed = after(CLOSED, confirms("clear"), *TRIED, found()).state
    assert after(passed, lease("bob")).state.by_hand
    worse = after(passed, found(arm="it is moving"))
    assert (worse.state.passed, worse.commands) == (True, (AnnounceChecklist(),))
    assert after(passed, found()).commands == ()
    assert after(passed, confirms("everything")).commands == ()


def test_the_item_of_stop_says_what_to_press_next() -> None:
    said = [after(CLOSED, *TRIED[:count], found()).state.items[2].said for count in range(3)]
    assert said == ["press STOP in the bar above, and then Resume", "now press Resume", ""]


def test_there_are_no_other_items_and_open_ones_are_named() -> None:
    assert texts(after(CLOSED, confirms("everything"))) == ["The checklist has no item 'everything'."]
    assert "Still open: all of it" in CLOSED.blocked_reason
    assert "Nobody is near" in after(CLOSED, found()).state.blocked_reason
    assert state().blocked_reason == ""


# Motions that an operator asks for, and the hand


def asked(*motions: Any) -> MotionsRequest:
    return MotionsRequest(RequestedMotions("ann", motions), fresh_id("asked"))


def over(state: SessionState, *, made: bool = True) -> RequestedEnd:
    """The end of the motion that is due."""
    return RequestedEnd(made=made, asked=state.requested.asked if state.requested else "")


def hand(act: Any) -> HandRequest:
    return HandRequest(id=fresh_id("hand"), time_s=12.0, operator="ann", act=act)


def test_what_is_asked_for_voids_the_plan_and_is_due_until_it_is_made() -> None:
    shown = tuple(synthetic.transition(synthetic.rope(0.1), synthetic.rope(bend)) for bend in (0.2, 0.3))
    new = after(state(), Offer(PLAN), asked(*shown)).state
    assert (new.interrupted, new.mode) == ("gives way to what was asked for", "approve each")
    assert new.requested is not None
    assert new.requested.demonstration == shown
    new = after(new, over(new)).state
    assert new.requested is not None
    assert new.requested.demonstration == shown[1:]
    assert after(new, over(new)).state.requested is None
    assert after(new, over(new, made=False)).state.requested is None
    begin = state()
    assert after(begin, over(new)) == Reduced(begin)


def test_the_end_of_one_request_leaves_what_was_asked_for_meanwhile() -> None:
    shown = tuple(synthetic.transition(synthetic.rope(0.1), synthetic.rope(bend)) for bend in (0.2, 0.3))
    first = after(state(mode="idle"), asked()).state
    second = after(first, asked(*shown)).state
    late = after(second, over(first)).state
    assert late.requested is not None
    assert (late.requested.demonstration, late.requested.resting) == (shown, True)
    assert after(late, over(late), over(late)).state.mode == "idle"


@pytest.mark.parametrize("made", [True, False])
def test_a_session_at_rest_approves_what_was_asked_for_and_rests_again(made: bool) -> None:
    begun = after(state(mode="idle"), asked())
    assert begun.state.mode == "approve each"
    assert isinstance(begun.commands[0], AnnounceMode)
    ended = after(begun.state, over(begun.state, made=made)).state
    assert (ended.mode, ended.requested) == ("idle", None)
    assert after(begun.state, stop()).state.mode == "idle"
    assert after(begun.state, Interruption("is void")).state.mode == "idle"


@pytest.mark.parametrize("event", [stop(), chosen("plan only"), Interruption("is void"), hand("take"), EndRequest])
def test_whatever_makes_plans_void_ends_what_was_asked_for(event: Any) -> None:
    if event is EndRequest:
        event = EndRequest(id=fresh_id("end"), time_s=0.0, operator="ann")
    assert after(state(), asked(), event).state.requested is None


@pytest.mark.parametrize(
    "fields", [{"mode": "automatic"}, {"mode": "plan only"}, {"mode": "teleoperate"}, {"stopped": True}]
)
def test_nothing_is_offered_in_other_modes_or_under_a_stop(fields: dict[str, Any]) -> None:
    begin = state(**fields)
    reduced = after(begin, asked())
    assert reduced.state is begin
    assert "Nothing is offered" in texts(reduced)[0]


def test_a_hand_takes_over_under_a_stop_of_its_own_which_it_lifts() -> None:
    taken = after(state(), hand("take")).state
    assert (taken.mode, taken.stopped, taken.holder) == ("teleoperate", True, "ann")
    ended = after(taken, motion_end("stopped", held=True))
    assert ended.state is taken
    assert texts(ended) == ["The motion ended where ann took over."]
    heeded = after(taken, Resumption("ann", 13.0)).state
    assert (heeded.stopped, heeded.taken) == (False, None)
    back = after(heeded, hand("give")).state
    assert (back.mode, back.holder) == ("approve each", "ann")


@pytest.mark.parametrize("ended", [motion_end("fault"), motion_end("stopped"), motion_end("fault", held=True)])
def test_a_hand_does_not_lift_what_the_arm_stopped_for_itself(ended: Any) -> None:
    held = after(state(), hand("take"), ended).state
    assert (held.stopped, held.taken) == (True, None)


@pytest.mark.parametrize("leaves", [hand("give"), chosen("idle"), lease("bob")])
def test_a_hand_that_has_not_taken_over_yet_lifts_nothing_when_the_mode_is_left(leaves: Any) -> None:
    left = after(state(), hand("take"), leaves).state
    assert (left.stopped, left.taken) == (True, None)
    assert left.mode != "teleoperate"
    assert texts(after(left, Resumption("ann", 13.0))) == ["Resumed by ann."]


def test_a_stop_that_is_pressed_while_a_hand_takes_over_is_not_lifted_by_it() -> None:
    stopped = after(state(), hand("take"), stop()).state
    assert (stopped.stopped, stopped.taken, stopped.pressed) == (True, None, True)
    refused = after(state(stopped=True), hand("take"))
    assert (refused.state.taken, refused.state.mode) == (None, "approve each")
    assert "press Resume" in texts(refused)[0]


@pytest.mark.parametrize(
    ("begin", "mode"),
    [
        ({"mode": "automatic", "holder": "ann"}, "approve each"),
        ({"automatic": True}, "automatic"),
        ({"mode": "idle"}, "idle"),
        ({"mode": "plan only"}, "plan only"),
    ],
)
def test_a_hand_gives_back_to_the_mode_before_and_never_to_motions_that_nobody_approves(
    begin: dict[str, Any], mode: ModeName
) -> None:
    new = after(state(**begin), hand("take"), Resumption("ann", 13.0), hand("give")).state
    assert new.mode == mode
    assert "nothing to give back" in texts(after(new, hand("give")))[0]
