"""Presses in the console, and the requests that they become, from whatever thread they come."""

import itertools
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from app.core.dialogue.control import Lease
from app.core.dialogue.requests import ColourRequest, EditRequest, ModelRequest
from app.core.messages import Decision, Fault, Notice, ResumeRequest, StopRequest, fresh_id
from app.ui.parts.operator_controller import OperatorController, Request
from tests.ui import synthetic

ENDS = np.array([0.4, -0.1, 0.006]), np.array([0.5, -0.1, 0.006])
PROPOSAL = synthetic.proposal(synthetic.rope(0.5))


class Program:
    """The other side of a controller: keeps in order what reaches the arm and what reaches the program."""

    def __init__(self) -> None:
        self.heard: list[Request | str] = []
        ticks = itertools.count()
        self.controller = OperatorController(
            stop=lambda: self.heard.append("arm stopped"), post=self.heard.append, now=lambda: float(next(ticks))
        )

    @property
    def requests(self) -> list[Request]:
        """Requests to the program, without those that took control for them."""
        return [entry for entry in self.heard if not isinstance(entry, str | Lease)]

    @property
    def said(self) -> list[str]:
        """Texts of the record: who got control and why, and refusals."""
        return [
            f"{entry.holder or 'nobody'}: {entry.why}" if isinstance(entry, Lease) else entry.text
            for entry in self.heard
            if isinstance(entry, Lease | Notice)
        ]


def test_a_press_on_stop_reaches_the_arm_first_and_in_its_own_thread():
    threads: list[int] = []
    posted: list[Request] = []
    controller = OperatorController(stop=lambda: threads.append(threading.get_ident()), post=posted.append)
    thread = threading.Thread(target=controller.stop, args=("me",))
    thread.start()
    thread.join()
    assert threads == [thread.ident]
    assert [type(request) for request in posted] == [StopRequest]


def test_a_stop_that_fails_is_not_reported_as_one():
    def broken() -> None:
        raise OSError("the arm's process is gone")

    posted: list[Request] = []
    controller = OperatorController(stop=broken, post=posted.append)
    try:
        controller.stop("me")
    except OSError:
        pass
    else:
        raise AssertionError("The failure went unseen.")
    assert posted == []


def test_every_repeated_stop_reaches_the_arm_and_the_first_one_the_record():
    program = Program()
    for _ in range(5):
        program.controller.stop("me")
    assert program.heard.count("arm stopped") == 5
    assert [type(request) for request in program.requests] == [StopRequest]


def test_a_stop_after_a_resume_is_a_new_one():
    program = Program()
    program.controller.stop("me")
    program.controller.resume("me")
    program.controller.stop("me")
    assert [type(request) for request in program.requests] == [StopRequest, ResumeRequest, StopRequest]


def test_there_is_nothing_to_resume_where_nothing_is_stopped():
    program = Program()
    program.controller.resume("me")
    assert program.heard == []


def test_a_decision_carries_the_digest_of_the_motion_the_button_belongs_to():
    program = Program()
    program.controller.show(PROPOSAL)
    program.controller.decide(PROPOSAL, approve=True, operator="client 3")
    (decision,) = program.requests
    assert isinstance(decision, Decision)
    assert decision.digest == PROPOSAL.motion.digest()
    assert decision.proposal_id == PROPOSAL.id
    assert decision.cause == (PROPOSAL.id,)
    assert decision.operator == "client 3"


def test_a_press_that_belongs_to_a_replaced_plan_has_no_effect():
    program = Program()
    program.controller.show(PROPOSAL)
    program.controller.show(synthetic.proposal(synthetic.rope(0.4), seed=1))
    program.controller.decide(PROPOSAL, approve=True, operator="me")
    assert program.heard == []


def test_nothing_is_approved_while_a_stop_is_in_force():
    program = Program()
    program.controller.show(PROPOSAL)
    program.controller.stop("me")
    program.controller.decide(PROPOSAL, approve=True, operator="me")
    assert [type(request) for request in program.requests] == [StopRequest]


def test_of_many_simultaneous_decisions_one_counts():
    program = Program()
    program.controller.show(PROPOSAL)
    together = threading.Barrier(16)

    def press(number: int) -> None:
        together.wait()
        program.controller.decide(PROPOSAL, approve=number % 2 == 0, operator=f"client {number}")

    with ThreadPoolExecutor(16) as clients:
        list(clients.map(press, range(16)))
    assert len(program.requests) == 1


def decided(program: Program) -> list[str]:
    return [request.operator for request in program.requests if isinstance(request, Decision)]


def test_whoever_commands_first_takes_control_and_nobody_else_may_command_then():
    program = Program()
    program.controller.show(PROPOSAL)
    program.controller.stop("client 2")
    program.controller.resume("client 0")
    program.controller.decide(PROPOSAL, approve=True, operator="client 1")
    assert decided(program) == []
    program.controller.decide(PROPOSAL, approve=True, operator="client 0")
    assert decided(program) == ["client 0"]
    assert program.said == ["client 0: nobody had it", "client 1 has no control; client 0 has. Take it first."]


def test_everybody_may_stop_whoever_has_control():
    program = Program()
    program.controller.take("client 0")
    program.controller.stop("client 1")
    assert program.heard.count("arm stopped") == 1
    assert isinstance(program.requests[-1], StopRequest)
    program.controller.resume("client 1")
    assert isinstance(program.requests[-1], Notice)
    assert program.controller.state.is_stopped


def test_control_is_given_back_left_behind_or_taken_from_who_does_not_use_it():
    now_s = 0.0
    program = Program()
    program.controller.now = lambda: now_s
    program.controller.take("client 0")
    program.controller.take("client 1")
    program.controller.release("client 1")
    assert program.controller.state.holder == "client 0"
    program.controller.release("client 0")
    program.controller.take("client 1")
    program.controller.on_disconnect("client 0")
    assert program.controller.state.holder == "client 1"
    program.controller.on_disconnect("client 1")
    assert program.controller.state.holder == ""
    program.controller.take("client 2")
    now_s = 59.0
    program.controller.take("client 3")
    assert program.controller.state.holder == "client 2"
    now_s = 61.0
    program.controller.take("client 3")
    assert program.controller.state.holder == "client 3"
    assert program.said[1] == "client 1 cannot take control: client 0 has it, and used it 0 s ago."
    assert program.said[-1] == "client 3: from client 2, who did not use it"


def test_commands_come_no_faster_than_a_person_presses_and_stop_as_fast_as_it_is_pressed():
    program, ticks = Program(), itertools.count()
    program.controller.now = lambda: 1e-6 * next(ticks)
    for _ in range(50):
        program.controller.stop("client 0")
        program.controller.resume("client 0")
    assert program.heard.count("arm stopped") == 50
    assert sum(isinstance(request, ResumeRequest) for request in program.requests) == 10
    assert "client 0 sends commands too fast; some are ignored." in program.said


def test_who_is_turned_away_a_thousand_times_is_one_line():
    now_s = 0.0
    program = Program()
    program.controller.now = lambda: now_s
    for _ in range(1000):
        program.controller.turned_away("The token is wrong.")
    now_s = 11.0
    program.controller.turned_away("Too many browsers at a time.")
    assert program.said == [
        "Somebody was refused. The token is wrong, once.",
        "Somebody was refused. The token is wrong, 999 times; Too many browsers at a time, once.",
    ]


def test_the_echo_of_a_lease_that_has_ended_gives_nothing_back():
    program = Program()
    program.controller.take("client 1")
    (first,) = (entry for entry in program.heard if isinstance(entry, Lease))
    program.controller.release("client 1")
    program.controller.take("client 2")
    program.controller.show(first)
    assert program.controller.state.holder == "client 2"
    program.controller.show(PROPOSAL)
    program.controller.decide(PROPOSAL, approve=True, operator="client 1")
    assert decided(program) == []


def test_a_press_that_comes_after_its_browser_has_left_does_nothing():
    program = Program()
    program.controller.show(PROPOSAL)
    program.controller.on_disconnect("client 0")
    program.controller.decide(PROPOSAL, approve=True, operator="client 0")
    program.controller.take("client 0")
    assert program.heard == []
    assert program.controller.state.holder == ""


def test_whoever_presses_without_end_fills_neither_the_log_nor_the_queue():
    program, ticks = Program(), itertools.count()
    program.controller.now = lambda: 1e-6 * next(ticks)
    program.controller.take("client 0")
    program.controller.show(PROPOSAL)
    for _ in range(1000):
        program.controller.take("client 1")
        program.controller.decide(PROPOSAL, approve=True, operator="client 1")
        program.controller.release("client 0")
        program.controller.take("client 0")
    assert len(program.heard) < 30


def test_a_change_is_asked_for_once_of_the_plan_that_is_up_by_who_has_control():
    program = Program()
    program.controller.edit(PROPOSAL, 1, *ENDS, "me")
    assert program.heard == []
    program.controller.show(PROPOSAL)
    program.controller.edit(synthetic.proposal(synthetic.rope(0.5)), 1, *ENDS, "me")
    assert program.heard == []
    for _ in range(2):
        program.controller.edit(PROPOSAL, 1, *ENDS, "me")
    (request,) = program.requests
    assert isinstance(request, EditRequest)
    assert (request.proposal_id, request.branch, request.operator) == (PROPOSAL.id, 1, "me")
    np.testing.assert_array_equal(request.end, ENDS[1])
    program.controller.show(synthetic.notice("edit", "It is too long."))
    program.controller.edit(PROPOSAL, 1, *ENDS, "another")
    assert isinstance(program.requests[-1], Notice)
    program.controller.edit(PROPOSAL, 2, *ENDS, "me")
    assert isinstance(program.requests[-1], EditRequest)
    program.controller.stop("me")
    program.controller.show(synthetic.notice("edit", "It is too long."))
    program.controller.edit(PROPOSAL, 1, *ENDS, "me")
    assert isinstance(program.requests[-1], StopRequest)


def test_a_plan_may_be_decided_on_while_a_change_of_it_is_simulated():
    program = Program()
    program.controller.show(PROPOSAL)
    program.controller.edit(PROPOSAL, 0, *ENDS, "me")
    program.controller.decide(PROPOSAL, approve=True, operator="me")
    assert [type(request) for request in program.requests] == [EditRequest, Decision]
    assert program.controller.state.edit is None


def test_a_model_and_colours_are_asked_for_by_whoever_has_control_and_by_nobody_else():
    program = Program()
    model = synthetic.model(3, 2e-5)
    program.controller.use_model(model, "version 3", operator="me")
    program.controller.use_colours(synthetic.COLOUR, operator="me")
    program.controller.use_model(model, "version 3", operator="another")
    program.controller.use_colours(synthetic.COLOUR, operator="another")
    asked, recoloured, *refused = program.requests
    assert isinstance(asked, ModelRequest)
    assert (asked.model, asked.source, asked.operator) == (model, "version 3", "me")
    assert isinstance(recoloured, ColourRequest)
    assert recoloured.hue_deg == synthetic.COLOUR.hue_deg
    assert [type(each) for each in refused] == [Notice, Notice]


def test_the_tool_is_moved_by_whoever_has_control_in_teleoperation_while_nothing_is_stopped():
    program = Program()
    controller = program.controller
    assert controller.blocked_reason("me") == "nobody has control: press Take first"
    controller.take("me")
    assert controller.blocked_reason("me") == "choose the mode By hand first"
    controller.show(synthetic.mode("teleoperate"))
    assert controller.blocked_reason("me") is None
    assert controller.blocked_reason("you") == "me has control"
    controller.stop("you")
    assert controller.blocked_reason("me") == "a stop is in force: press Resume"
    controller.resume("me")
    assert controller.blocked_reason("me") is None
    controller.show(synthetic.arm("fault"))
    assert controller.blocked_reason("me") == "a stop is in force: press Resume"
    controller.show(synthetic.arm("moving"))
    controller.show(synthetic.mode("approve each"))
    assert controller.blocked_reason("me") == "choose the mode By hand first"
    controller.on_disconnect("me")
    assert controller.blocked_reason("me") == "me has left"
    controller.show(Fault(id=fresh_id("fault"), time_s=0.0, where="episode", text="over", fatal=True))
    assert controller.blocked_reason("you") == "the program has ended"


def test_whoever_moves_the_tool_uses_his_control_and_keeps_it():
    now_s = 0.0
    posted: list[Request] = []
    controller = OperatorController(stop=lambda: None, post=posted.append, now=lambda: now_s)
    controller.take("me")
    controller.show(synthetic.mode("teleoperate"))
    now_s = 50.0
    assert controller.blocked_reason("me") is None
    now_s = 100.0
    controller.take("you")
    assert controller.state.holder == "me"
    now_s = 120.0
    controller.take("you")
    assert controller.state.holder == "you"


def test_on_the_desk_of_a_replay_nobody_commands_and_a_jump_forgets_what_was_shown():
    posted, stopped = list[object](), list[str]()
    controller = OperatorController(stop=lambda: stopped.append("stop"), post=posted.append, replay=True)
    for message in synthetic.scene():
        controller.show(message)
    pending = controller.state.pending
    assert pending is not None
    assert not controller.state.decidable
    controller.decide(pending, approve=True, operator="client 0")
    controller.take("client 0")
    controller.stop("client 0")
    controller.on_disconnect("client 0")
    assert (posted, stopped) == ([], [])
    goal = synthetic.goal()
    controller.reset([goal])
    assert (controller.state.goal, controller.state.pending, controller.state.outcomes) == (goal, None, ())
    assert controller.state.replay
