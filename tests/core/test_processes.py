"""Real-time priority: urgent threads run before ordinary programs, where the system allows it."""

import os
import threading
from multiprocessing.queues import SimpleQueue

import pytest

from app.core.system.processes import in_real_time, may_run_in_real_time, start_ordinary
from app.core.system.ring import SPAWN


def _policy_of_thread() -> int:
    """Scheduling policy of a thread that is started now."""
    found = list[int]()
    thread = threading.Thread(target=lambda: found.append(os.sched_getscheduler(0)))
    thread.start()
    thread.join()
    return found[0]


def _say_policy(to: "SimpleQueue[int]") -> None:
    to.put(os.sched_getscheduler(0))


def test_an_application_goes_before_ordinary_programs_with_the_threads_it_has_and_gets_and_not_for_ever() -> None:
    inside = os.SCHED_RR if may_run_in_real_time() else os.SCHED_OTHER
    waits, policies = threading.Event(), list[int]()

    def was_there() -> None:
        waits.wait()
        policies.append(os.sched_getscheduler(0))

    thread = threading.Thread(target=was_there)
    thread.start()
    with in_real_time():
        policies += [os.sched_getscheduler(0), _policy_of_thread()]
        waits.set()
        thread.join()
    assert policies == [inside] * 3
    assert [os.sched_getscheduler(0), _policy_of_thread()] == [os.SCHED_OTHER] * 2


@pytest.mark.serial
def test_a_process_that_it_starts_is_an_ordinary_one() -> None:
    answers: SimpleQueue[int] = SPAWN.SimpleQueue()
    child = SPAWN.Process(target=_say_policy, args=(answers,))
    with in_real_time():
        before = os.sched_getscheduler(0)
        start_ordinary(child)
        child.join()
        assert os.sched_getscheduler(0) == before
    assert child.exitcode == 0
    assert answers.get() == os.SCHED_OTHER
