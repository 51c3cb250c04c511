"""The stage that watches the model: a message after every push, one notice when it stops being right."""

from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

import anyio
import numpy as np
import pytest

from app.core.announcer import MessageBus
from app.core.dialogue.model_monitor_messages import Verdict, Watched
from app.core.dialogue.summary import Summary
from app.core.messages import Message, Model, Notice, Transition, fresh_id
from app.discovery.monitor.change_detection import FIRST
from app.session.model_monitor import ExecutedPush, Watching
from tests.session.cell import MemoryLog, Request
from tests.session.virtual import VirtualClock
from tests.ui import synthetic

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]

RIGHT, WRONG = 12, 14
VERDICT = Verdict(
    id=fresh_id("verdict"), time_s=0.0, source="", kind="none", sentences=(), causes=(), ranking=(), promised_share=0.1
)


class Shown:
    """An operator who asks for nothing and remembers; `done` once so many pushes have been judged."""

    def __init__(self, pushes: int) -> None:
        self.seen: list[Message] = []
        self.done = anyio.Event()
        self._pushes = pushes

    def show(self, message: Message) -> None:
        self.seen.append(message)
        self._pushes -= isinstance(message, Watched)
        if not self._pushes:
            self.done.set()

    async def requests(self) -> AsyncIterator[Request]:
        for request in list[Request]():
            yield request


def push(error_m: float, rng: np.random.Generator, model: Model | None = None) -> ExecutedPush:
    """A push over 30 mm, of which the object makes `error_m` less."""
    angle = rng.uniform(0, 2 * np.pi)
    ahead = np.float32([np.cos(angle), np.sin(angle), 0])
    observed = synthetic.rope(0.5)
    proposal = synthetic.proposal(observed, branches=1)
    predicted = (observed + np.float32(0.03) * ahead).astype(np.float32)
    way = np.array([0.5, 0.0, 0.006]) + np.linspace(-0.1, 0.05, 30)[:, None] * ahead
    executed = synthetic.executed(way)
    after = (predicted - np.float32(error_m) * ahead + 3e-4 * rng.normal(size=observed.shape)).astype(np.float32)
    transition = Transition(
        id=fresh_id("transition"), time_s=anyio.current_time(), before=observed, executed=executed, after=after
    )
    branch = replace(proposal.branches[0], predicted=predicted)
    return ExecutedPush(replace(proposal, branches=(branch,), best=0), transition, model)


async def watched(
    pushes: list[ExecutedPush], verdict: Verdict | None = None, recording: Path | None = None
) -> list[Message]:
    shown, clock, summary = Shown(len(pushes)), VirtualClock(), Summary()
    announcer = MessageBus(operator=shown, recorder=MemoryLog(), clock=clock, summary=summary)
    watching = Watching(announcer, clock, verdict, recording)
    async with anyio.create_task_group() as tasks:
        tasks.start_soon(watching.run)
        for one in pushes:
            await watching.put(one)
        with anyio.fail_after(60):
            await shown.done.wait()
        tasks.cancel_scope.cancel()
    return shown.seen


async def test_every_push_is_judged_and_the_alarm_said_once_with_what_to_do() -> None:
    rng = np.random.default_rng(0)
    errors = [*rng.uniform(0.001, 0.003, RIGHT), *rng.uniform(0.012, 0.016, WRONG)]
    pushes = [push(float(error_m), rng) for error_m in errors]
    seen = await watched(pushes, recording=Path("recordings/now.mcap"))
    judged = [message for message in seen if isinstance(message, Watched)]
    assert [one.cause for one in judged] == [(one.transition.id,) for one in pushes]
    assert [one.state for one in judged[: FIRST + 2]] == ["learning"] * FIRST + ["right"] * 2
    assert judged[-1].state == "wrong"
    assert abs(judged[-1].since - (RIGHT + 1)) <= 2
    (notice,) = [message for message in seen if isinstance(message, Notice)]
    assert "stopped being right" in notice.text
    assert "less far along the push" in notice.text
    assert "dipac discover recordings/now.mcap" in notice.text


async def test_a_verdict_is_said_first_and_what_it_promised_is_held_against_the_model() -> None:
    rng = np.random.default_rng(1)
    seen = await watched([push(0.015, rng) for _ in range(12)], verdict=VERDICT)
    assert seen[0] is VERDICT
    judged = [message for message in seen if isinstance(message, Watched)]
    assert judged[0].promised_m == pytest.approx(0.003, rel=0.1)
    assert judged[0].state == "right"
    assert judged[-1].state == "wrong"
    assert judged[-1].since == 1


async def test_a_model_that_was_fitted_to_enough_pushes_promises_its_loss() -> None:
    rng, model = np.random.default_rng(2), synthetic.model(9, 2e-6)
    fitted = replace(model, transition_count=FIRST)
    few = replace(model, transition_count=FIRST - 1)
    first, second = await watched([push(0.001, rng, fitted), push(0.001, rng, few)])
    assert isinstance(first, Watched)
    assert isinstance(second, Watched)
    assert first.promised_m == pytest.approx(1e-3)
    assert np.isnan(second.promised_m)
