"""A planner whose process dies: replaced, and given up the third time in a row. In real time, with real processes."""

from pathlib import Path

import pytest

from app.core.errors import WorkerError
from app.core.messages import Fault, Health, Proposal
from tests.session.cell import fresh_plan, pushes, running, small_site, small_wish
from tests.session.planner import Habits

pytestmark = pytest.mark.anyio

DYING = Habits(thinking_s=1.0, failures=1, trouble="dies")


@pytest.fixture(scope="module")
def anyio_backend() -> str:
    return "asyncio"


async def test_a_planner_that_dies_once_is_replaced(tmp_path: Path) -> None:
    async with running(small_site(tmp_path), small_wish()) as cell:
        person, first = cell.person, await fresh_plan(cell)
        await cell.plans_with(DYING)
        await person.decides(first, approve=False)
        await person.sees(Health, "planning")
        # Callers take turns: this one comes before the second attempt, in the process that replaces the dead one.
        await cell.plans_with(Habits())
        await person.sees(Fault, "planner The planner process ended with code -9")
        assert (await pushes(cell, await person.sees(Proposal))).outcome == "completed"


async def test_a_planner_that_dies_three_times_in_a_row_ends_the_run(tmp_path: Path) -> None:
    async with running(small_site(tmp_path), small_wish(), habits=DYING) as run:
        await run.person.sees(Health, "planning")
        for _ in range(2):
            await run.plans_with(DYING)
        error = await run.end()
        assert isinstance(error, WorkerError)
        assert all("code -9" in fault.text for fault in run.person.all(Fault) if not fault.fatal)
