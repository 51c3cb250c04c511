"""Motions that somebody makes by jogging: heeded in one mode alone, recorded and learned from like any other."""

from collections.abc import AsyncIterator
from pathlib import Path

import anyio
import numpy as np
import pytest

from app.core.dialogue.control import EndRequest, Lease, Mode
from app.core.messages import Executed, Health, Notice, Outcome, Particles, Proposal, Transition, fresh_id
from tests.session.cell import Run, for_a_while, jogs, running, small_site, small_wish, some
from tests.session.planner import Habits

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]


@pytest.fixture(scope="module")
async def session(tmp_path_factory: pytest.TempPathFactory, anyio_backend: str) -> AsyncIterator[Run]:
    site = small_site(tmp_path_factory.mktemp("session"), jog_rest_s=0.15)
    async with running(site, small_wish(staying=True)) as run:
        await run.person.sees(Proposal)
        yield run


@pytest.fixture
async def by_hand(session: Run) -> Run:
    """The session, in teleoperation."""
    session.person.look_away()
    await session.person.chooses("idle")
    await session.person.chooses("teleoperate")
    await session.person.sees(Mode, "teleoperate")
    await session.person.sees(Health, "waiting to be moved by hand")
    return session


async def test_from_the_first_jog_to_rest_is_one_motion_with_what_came_of_it(by_hand: Run) -> None:
    outcomes, begun = len(by_hand.person.all(Outcome)), list(by_hand.rig.arm.begun)
    assert await jogs(by_hand, (0.05, 0.0, 0.0)) == 12
    executed = await by_hand.person.sees(Executed)
    assert executed.outcome == "completed"
    assert executed.measured[-1, 0] - executed.measured[0, 0] > 0.005
    np.testing.assert_allclose(executed.measured[-1, 1:3], executed.measured[0, 1:3], atol=1e-3)
    transition = await by_hand.person.sees(Transition)
    assert executed.id in transition.cause
    assert transition.executed.times_s[0] == executed.times_s[0]
    assert len(by_hand.person.all(Outcome)) == outcomes, "nothing was predicted of it, so nothing is scored"
    assert by_hand.rig.arm.begun == begun
    await by_hand.person.sees(Health, "waiting to be moved by hand")


async def test_in_other_modes_no_jog_is_heeded(by_hand: Run) -> None:
    await by_hand.person.chooses("idle")
    await by_hand.person.sees(Health, "idle")
    assert await jogs(by_hand, (0.05, 0.0, 0.0)) == 0
    assert not some(Executed, await for_a_while(by_hand))


async def test_a_stop_by_hand_holds_until_somebody_resumes(by_hand: Run) -> None:
    person = by_hand.person
    async with anyio.create_task_group() as tasks:
        tasks.start_soon(jogs, by_hand, (0.0, 0.05, 0.0))
        await anyio.sleep(0.15)
        await person.presses_stop()
        assert (await person.sees(Executed)).outcome == "stopped"
    assert await jogs(by_hand, (0.05, 0.0, 0.0), samples=3) == 0
    await person.sees(Notice, "Press Resume in the console to go on")
    await person.presses_resume()
    await person.sees(Health, "waiting to be moved by hand")
    assert await jogs(by_hand, (0.0, 0.0, 0.05)) == 12
    assert (await person.sees(Executed)).outcome == "completed"


async def test_teleoperation_ends_with_control_and_the_arm_comes_to_rest(by_hand: Run) -> None:
    async with anyio.create_task_group() as tasks:
        tasks.start_soon(jogs, by_hand, (0.0, -0.05, 0.0))
        await anyio.sleep(0.1)
        lease = Lease(id=fresh_id("lease"), time_s=anyio.current_time(), holder="another", why="tests")
        await by_hand.person.asks(lease)
        await by_hand.person.sees(Mode, "idle")
        tasks.cancel_scope.cancel()
    await by_hand.person.sees(Health, "idle")
    assert (await by_hand.rig.arm.state()).mode == "idle"


async def test_nobody_who_moves_the_tool_by_hand_waits_for_the_planner_to_compile(tmp_path: Path) -> None:
    site = small_site(tmp_path, jog_rest_s=0.15)
    async with running(site, small_wish(staying=True), habits=Habits(compiling_s=500.0)) as run:
        person = run.person
        await person.sees(Health, "compiling strokes")
        await person.chooses("teleoperate")
        await person.sees(Health, "waiting to be moved by hand")
        await person.sees(Particles)
        assert await jogs(run, (0.0, 0.0, 0.05)) == 12
        await person.sees(Transition)
        await person.chooses("approve each")
        await person.sees(Health, "compiling strokes")
        await person.asks(EndRequest(id=fresh_id("end"), time_s=anyio.current_time(), operator="tests"))
        assert await run.end() is None
        assert not person.all(Proposal)
