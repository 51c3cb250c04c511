"""What a press does, from whatever thread it comes."""

import itertools
import threading
from concurrent.futures import ThreadPoolExecutor

from app.core.messages import Decision, ResumeRequest, StopRequest
from app.ui.desk import Desk, Request
from tests.ui import synthetic

PROPOSAL = synthetic.proposal(synthetic.rope(0.5))


class Program:
    """The other side of a desk: keeps in order what reaches the arm and what reaches the program."""

    def __init__(self) -> None:
        self.heard: list[Request | str] = []
        ticks = itertools.count()
        self.desk = Desk(
            stop=lambda: self.heard.append("arm stopped"), post=self.heard.append, now=lambda: float(next(ticks))
        )

    @property
    def requests(self) -> list[Request]:
        return [entry for entry in self.heard if not isinstance(entry, str)]


def test_a_press_on_stop_reaches_the_arm_first_and_in_its_own_thread():
    threads: list[int] = []
    posted: list[Request] = []
    desk = Desk(stop=lambda: threads.append(threading.get_ident()), post=posted.append)
    thread = threading.Thread(target=desk.stop, args=("me",))
    thread.start()
    thread.join()
    assert threads == [thread.ident]
    assert [type(request) for request in posted] == [StopRequest]


def test_a_stop_that_fails_is_not_reported_as_one():
    def broken() -> None:
        raise OSError("the arm's process is gone")

    posted: list[Request] = []
    desk = Desk(stop=broken, post=posted.append)
    try:
        desk.stop("me")
    except OSError:
        pass
    else:
        raise AssertionError("The failure went unseen.")
    assert posted == []


def test_every_repeated_stop_reaches_the_arm_and_the_first_one_the_record():
    program = Program()
    for _ in range(5):
        program.desk.stop("me")
    assert program.heard.count("arm stopped") == 5
    assert [type(request) for request in program.requests] == [StopRequest]


def test_a_stop_after_a_resume_is_a_new_one():
    program = Program()
    program.desk.stop("me")
    program.desk.resume("me")
    program.desk.stop("me")
    assert [type(request) for request in program.requests] == [StopRequest, ResumeRequest, StopRequest]


def test_there_is_nothing_to_resume_where_nothing_is_stopped():
    program = Program()
    program.desk.resume("me")
    assert program.heard == []


def test_a_decision_carries_the_digest_of_the_motion_the_button_belongs_to():
    program = Program()
    program.desk.show(PROPOSAL)
    program.desk.decide(PROPOSAL, approve=True, operator="client 3")
    (decision,) = program.requests
    assert isinstance(decision, Decision)
    assert decision.digest == PROPOSAL.motion.digest()
    assert decision.proposal_id == PROPOSAL.id
    assert decision.cause == (PROPOSAL.id,)
    assert decision.operator == "client 3"


def test_a_press_that_belongs_to_a_replaced_plan_has_no_effect():
    program = Program()
    program.desk.show(PROPOSAL)
    program.desk.show(synthetic.proposal(synthetic.rope(0.4), seed=1))
    program.desk.decide(PROPOSAL, approve=True, operator="me")
    assert program.heard == []


def test_nothing_is_approved_while_a_stop_is_in_force():
    program = Program()
    program.desk.show(PROPOSAL)
    program.desk.stop("me")
    program.desk.decide(PROPOSAL, approve=True, operator="me")
    assert [type(request) for request in program.requests] == [StopRequest]


def test_of_many_simultaneous_decisions_one_counts():
    program = Program()
    program.desk.show(PROPOSAL)
    together = threading.Barrier(16)

    def press(number: int) -> None:
        together.wait()
        program.desk.decide(PROPOSAL, approve=number % 2 == 0, operator=f"client {number}")

    with ThreadPoolExecutor(16) as clients:
        list(clients.map(press, range(16)))
    assert len(program.requests) == 1
