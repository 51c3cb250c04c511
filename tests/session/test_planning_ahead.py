"""Plans made while the arm moves: when there is one for the next decision, and when it is void."""

from collections.abc import AsyncIterator
from pathlib import Path

import numpy as np
import pytest

from app.core.dialogue.approval import Approved
from app.core.errors import MotionRefused
from app.core.messages import ArmState, Executed, Fault, Proposal
from app.core.rejection_codes import Refusal
from tests.session.cell import Run, pushes, running, small_site, small_wish
from tests.session.planner import Habits
from tests.session.test_modes import goal_request

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]
QUICK_S, SLOW_S = 0.1, 30.0


@pytest.fixture
async def cell(tmp_path: Path) -> AsyncIterator[Run]:
    """A session that has planned and moved once, and so knows how long a plan takes and has compiled what it needs."""
    async with running(small_site(tmp_path), small_wish(staying=True), habits=Habits(thinking_s=QUICK_S)) as run:
        await pushes(run, await run.person.sees(Proposal))
        yield run


async def test_the_next_plan_is_made_while_the_arm_moves(cell: Run) -> None:
    assert cell.session.parts.planning.ahead.begun == 0, "while the first motion was made, this was compiled"
    first = await cell.person.sees(Proposal)
    await pushes(cell, first)
    second = await cell.person.sees(Proposal)
    assert (first.ahead, second.ahead) == (False, True)
    assert (await pushes(cell, second)).outcome == "completed"
    assert (await cell.person.sees(Proposal)).ahead, "what was taken says nothing of how long a plan takes"


async def test_no_plan_is_begun_that_would_outlast_the_motion(cell: Run) -> None:
    await cell.plans_with(Habits(thinking_s=SLOW_S))
    first = await cell.person.sees(Proposal)
    await cell.person.decides(first, approve=False)
    slow = await cell.person.sees(Proposal)
    assert slow.plan_s >= SLOW_S
    await pushes(cell, slow)
    after = await cell.person.sees(Proposal)
    assert not after.ahead
    assert after.plan_s < 2 * SLOW_S, "nobody waits for a plan made ahead, and then for another"
    assert cell.session.parts.planning.ahead.begun == 0


async def test_a_stop_ends_what_was_planned_ahead(cell: Run) -> None:
    await cell.person.decides(await cell.person.sees(Proposal))
    await cell.person.sees(ArmState, "moving")
    await cell.person.presses_stop()
    await cell.person.sees(Executed, "stopped")
    await cell.person.presses_resume()
    assert not (await cell.person.sees(Proposal)).ahead


async def test_a_goal_given_while_the_arm_moves_ends_what_was_planned_ahead(cell: Run) -> None:
    first = await cell.person.sees(Proposal)
    await cell.person.decides(first)
    await cell.person.sees(ArmState, "moving")
    await cell.person.asks(goal_request(first.observed + np.array([0.0, 0.1, 0.0])))
    await cell.person.sees(Executed, "completed")
    assert not (await cell.person.sees(Proposal)).ahead


async def test_a_rejected_plan_is_not_followed_by_one_made_ahead(cell: Run) -> None:
    await pushes(cell, await cell.person.sees(Proposal))
    second = await cell.person.sees(Proposal)
    await cell.person.decides(second, approve=False)
    third = await cell.person.sees(Proposal)
    assert (second.ahead, third.ahead) == (True, False)


async def test_a_planner_that_fails_ahead_is_asked_again_afterwards(cell: Run) -> None:
    first = await cell.person.sees(Proposal)
    await cell.plans_with(Habits(thinking_s=QUICK_S, failures=1))
    await pushes(cell, first)
    second = await cell.person.sees(Proposal)
    assert cell.session.parts.planning.ahead.begun == 1
    assert not second.ahead
    assert not cell.person.all(Fault), "nobody has asked for that plan yet"


async def test_a_planner_that_dies_ahead_is_said_to(cell: Run) -> None:
    first = await cell.person.sees(Proposal)
    planner = cell.session.parts.planning.ahead
    await cell.person.decides(first)
    await cell.person.sees(ArmState, "moving")
    planner.begin((), first.observed, at=0)  # Without arguments the job fails as a dead process does.
    assert "planner" in (await cell.person.sees(Fault)).where
    assert not (await cell.person.sees(Proposal)).ahead


async def test_a_motion_that_the_arm_refuses_leaves_no_plan_made_ahead(
    cell: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def refuse(_: Approved) -> Executed:
        raise MotionRefused(Refusal.STOPPED, "Not now.")

    first = await cell.person.sees(Proposal)
    with monkeypatch.context() as patch:
        patch.setattr(cell.rig.arm, "execute", refuse)
        await cell.person.decides(first)
        await cell.person.sees(Fault)
    assert cell.session.parts.planning.ahead.begun == 1
    assert not (await cell.person.sees(Proposal)).ahead


async def test_a_plan_that_promises_nothing_is_not_kept_for_later(cell: Run) -> None:
    await cell.plans_with(Habits(thinking_s=QUICK_S, cost=0.0))
    first = await cell.person.sees(Proposal)
    await pushes(cell, first)
    assert cell.session.parts.planning.ahead.begun == 1
    assert not (await cell.person.sees(Proposal)).ahead


@pytest.mark.parametrize("count", [1, 3])
async def test_nothing_is_planned_ahead_of_the_last_motion(tmp_path: Path, count: int) -> None:
    async with running(
        small_site(tmp_path), small_wish(pushes=count, automatic=True), habits=Habits(thinking_s=QUICK_S)
    ) as run:
        assert await run.end() is None
        assert [each.ahead for each in run.person.all(Proposal)] == [False, False, True][:count]
        assert run.session.parts.planning.ahead.begun == count // 2
