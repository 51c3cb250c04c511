"""State of the console: it follows from the messages alone, in spite of echoes."""

import itertools
from dataclasses import replace

import pytest

from app.core.colours import ColourRange
from app.core.messages import ArmMode, Decision, Fault, Message, ResumeRequest, StopRequest, fresh_id
from app.ui.parts.console_state import LOG_LENGTH, ConsoleState
from tests.ui import synthetic


def state_after(*messages: Message) -> ConsoleState:
    state = ConsoleState()
    for message in messages:
        state = state.after(message)
    return state


def stop(time_s: float) -> StopRequest:
    return StopRequest(id=fresh_id("stop"), time_s=time_s, operator="me")


def resume(time_s: float) -> ResumeRequest:
    return ResumeRequest(id=fresh_id("resume"), time_s=time_s, operator="me")


def decision_on(proposal) -> Decision:
    return Decision(
        id=fresh_id("decision"),
        time_s=1.0,
        proposal_id=proposal.id,
        digest=proposal.motion.digest(),
        approve=True,
        operator="me",
    )


PROPOSAL = synthetic.proposal(synthetic.rope(0.5))
NEXT = synthetic.proposal(synthetic.rope(0.4), seed=1)


def test_a_proposal_can_be_decided_until_a_decision_is_seen_and_stays_drawn():
    state = state_after(PROPOSAL)
    assert state.decidable
    decided = state.after(decision_on(PROPOSAL))
    assert not decided.decidable
    assert decided.shown is PROPOSAL


def test_a_decided_proposal_that_is_shown_again_stays_decided():
    assert not state_after(PROPOSAL, decision_on(PROPOSAL), PROPOSAL).decidable


def test_a_decision_on_another_proposal_changes_nothing():
    assert state_after(PROPOSAL, NEXT, decision_on(PROPOSAL)).pending is NEXT


def test_a_notice_that_names_the_proposal_as_its_cause_withdraws_it():
    dropped = replace(synthetic.notice("plan", "dropped"), cause=(PROPOSAL.id,))
    assert state_after(PROPOSAL, synthetic.notice("plan", "unrelated")).decidable
    assert not state_after(PROPOSAL, dropped).decidable


def test_an_executed_motion_ends_what_was_pending():
    assert not state_after(PROPOSAL, synthetic.executed(PROPOSAL.motion.positions)).decidable


def test_stop_and_resume_hold_by_their_times_in_whatever_order_their_echoes_come():
    first, second, last = stop(1.0), resume(2.0), stop(3.0)
    for order in itertools.permutations((first, second, last)):
        assert state_after(*order, *order).is_stopped
    for order in itertools.permutations((first, second)):
        assert not state_after(*order, *order).is_stopped


def test_nothing_can_be_decided_while_stopped_and_again_after_resuming():
    stopped = state_after(PROPOSAL, stop(1.0))
    assert not stopped.decidable
    assert stopped.after(resume(2.0)).decidable


@pytest.mark.parametrize(
    ("mode", "stopped"),
    [("idle", False), ("moving", False), ("stopping", True), ("stopped", True), ("fault", True)],
)
def test_a_stop_made_elsewhere_is_seen_at_the_arm(mode: ArmMode, stopped: bool):
    assert state_after(synthetic.arm(mode)).is_stopped is stopped
    assert state_after(synthetic.health(arm_mode=mode)).is_stopped is stopped


def test_the_newer_of_two_reports_says_what_mode_the_arm_is_in():
    assert state_after(synthetic.health(arm_mode="stopped"), synthetic.arm("idle")).arm_mode == "idle"
    assert state_after(synthetic.arm("stopped"), synthetic.health(arm_mode="idle")).arm_mode == "idle"


def test_the_log_keeps_the_last_notices_and_faults_in_order():
    notices = [synthetic.notice("x", str(index)) for index in range(LOG_LENGTH + 3)]
    assert [entry.text for entry in state_after(*notices).log] == [n.text for n in notices[-LOG_LENGTH:]]


def test_after_a_fatal_fault_nothing_can_be_decided():
    fault = Fault(id=fresh_id("fault"), time_s=1.0, where="planner", text="gone", fatal=True)
    assert not state_after(PROPOSAL, fault).decidable
    assert state_after(PROPOSAL, replace(fault, fatal=False)).decidable


def test_every_camera_keeps_its_own_latest_frame():
    left, right = (synthetic.camera(name, 0.0) for name in ("left", "right"))
    old, new, other = (synthetic.frame(camera, synthetic.rope(0.5)) for camera in (left, left, right))
    assert state_after(old, other, new).frames == {"left": new, "right": other}


def test_losses_that_were_never_computed_are_not_plotted():
    assert state_after(synthetic.model(0, float("nan")), synthetic.model(1, 2e-5)).losses == ((1, 2e-5),)


def test_the_versions_of_a_session_are_kept_once_each_and_not_without_end():
    state = state_after(*(synthetic.model(version, 1e-5) for version in (*range(100), 99)))
    versions = [model.version for model in state.models]
    assert versions == list(range(36, 100))
    assert state.models[-1] is state.model


def test_the_last_motion_is_kept_as_it_was_predicted_and_seen():
    before, after = synthetic.rope(0.5), synthetic.rope(0.3, 1)
    state = state_after(PROPOSAL, synthetic.transition(before, after), NEXT)
    assert state.made is not None
    assert state.made.expected is PROPOSAL.chosen.predicted
    assert (state.made.before is before, state.made.after is after) == (True, True)
    assert state_after(synthetic.transition(before, after)).made is None


def test_colours_are_remembered_when_they_change():
    frame = synthetic.frame(synthetic.camera("left", 1.0), synthetic.rope(0.5))
    other = ColourRange(hue_low_deg=200.0, hue_high_deg=240.0)
    state = state_after(*(synthetic.seen(frame, colour=each) for each in (synthetic.COLOUR,) * 3 + (other,) * 2))
    assert state.colours == (synthetic.COLOUR, other)
    assert state.seen is not None
