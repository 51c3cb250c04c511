"""Workers compute elsewhere, pass errors on, die alone, and start again."""

import os
import signal

import anyio
import numpy as np
import pytest

from app.core.errors import PerceptionError, WorkerError
from app.core.system.worker import Worker

pytestmark = pytest.mark.anyio


def where() -> int:
    return os.getpid()


def double(values: np.ndarray) -> np.ndarray:
    return 2 * values


def fail() -> None:
    raise PerceptionError("The cloud is empty.")


def fail_unportably() -> None:
    raise type("Local", (Exception,), {})("cannot be pickled")


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def niceness() -> int:
    return os.nice(0)


async def test_a_worker_computes_in_another_process_and_stays_the_same_one() -> None:
    async with Worker("test") as worker:
        first = await worker.run(where)
        assert first != os.getpid()
        assert await worker.run(where) == first
        np.testing.assert_array_equal(await worker.run(double, np.arange(3)), [0, 2, 4])


async def test_what_the_function_raises_arrives_as_it_was_raised() -> None:
    async with Worker("test") as worker:
        with pytest.raises(PerceptionError, match="The cloud is empty"):
            await worker.run(fail)
        with pytest.raises(WorkerError, match="cannot be pickled"):
            await worker.run(fail_unportably)


async def test_a_worker_that_dies_is_named_and_replaced() -> None:
    async with Worker("planner") as worker:
        first = await worker.run(where)
        with pytest.raises(WorkerError, match="planner process ended with code -9"):
            await worker.run(die)
        assert await worker.run(where) != first


async def test_a_cancelled_call_ends_its_process_and_the_next_call_gets_its_own_answer() -> None:
    async with Worker("test") as worker:
        first = await worker.run(where)
        with anyio.move_on_after(0.2):
            await worker.run(signal.pause)
        assert await worker.run(where) != first
        with pytest.raises(ProcessLookupError):
            os.kill(first, 0)


async def test_a_call_that_hangs_is_named_and_its_process_ended() -> None:
    async with Worker("planner", deadline_s=3.0) as worker:
        first = await worker.run(where)
        with pytest.raises(WorkerError, match="planner process had no answer after 3 s"):
            await worker.run(signal.pause)
        assert await worker.run(where) != first


async def test_calls_take_turns_and_each_gets_its_own_answer() -> None:
    answers: dict[int, np.ndarray] = {}

    async def ask(i: int) -> None:
        answers[i] = await worker.run(double, np.array([i]))

    async with Worker("test") as worker, anyio.create_task_group() as group:
        for i in range(8):
            group.start_soon(ask, i)
    assert {i: int(answer[0]) for i, answer in answers.items()} == {i: 2 * i for i in range(8)}


async def test_a_worker_yields_to_others_by_its_niceness() -> None:
    async with Worker("test", niceness=7) as worker:
        assert await worker.run(niceness) == os.nice(0) + 7
