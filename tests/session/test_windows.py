"""Requests at awkward moments: while the program looks, while it is stopped, amid a motion."""

from collections.abc import AsyncIterator

import anyio
import numpy as np
import pytest

from app.core.dialogue.approval import Approved
from app.core.dialogue.control import EndRequest, Mode
from app.core.dialogue.jog import Jog
from app.core.messages import Executed, Health, Notice, Proposal, Transition, fresh_id
from tests.session.cell import Run, for_a_while, jogs, running, small_site, small_wish, some

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]


@pytest.fixture
async def run(tmp_path) -> AsyncIterator[Run]:
    """A session that waits for approval."""
    async with running(small_site(tmp_path, jog_rest_s=0.15), small_wish(staying=True)) as run:
        await run.shows_a_plan()
        yield run


async def ends(run: Run) -> None:
    await run.person.asks(EndRequest(id=fresh_id("end"), time_s=anyio.current_time(), operator="tests"))
    assert await run.end() is None


async def looks_in_vain(run: Run) -> None:
    """See the next motion through, and the program look for an object that is covered meanwhile."""
    await run.person.sees(Approved)
    run.rig.table.place = "covered"
    await run.person.sees(Executed)
    await run.person.sees(Health, "looking at the object")


async def test_a_mode_that_is_chosen_while_the_program_looks_is_the_mode(run: Run) -> None:
    await run.person.decides(run.person.all(Proposal)[-1])
    await looks_in_vain(run)
    await run.person.chooses("idle")
    await run.person.sees(Mode, "idle")
    run.rig.table.place = "here"
    run.person.look_away()
    meanwhile = await for_a_while(run)
    assert not some(Proposal, meanwhile)
    assert (await run.person.sees(Health)).doing.startswith("idle")


async def test_nothing_is_moved_after_the_end_was_asked_for_while_the_program_looks(run: Run) -> None:
    await run.person.chooses("automatic", 100)
    await looks_in_vain(run)
    begun = list(run.rig.arm.begun)
    await run.person.asks(EndRequest(id=fresh_id("end"), time_s=anyio.current_time(), operator="tests"))
    run.rig.table.place = "here"
    assert await run.end() is None
    assert run.rig.arm.begun == begun


async def test_a_session_that_is_stopped_can_be_ended(run: Run) -> None:
    await run.person.presses_stop()
    await run.person.sees(Health, "stopped")
    await ends(run)


async def test_an_arm_that_was_stopped_by_itself_holds_the_session_and_breaks_nothing(run: Run) -> None:
    await run.person.chooses("teleoperate")
    await run.person.sees(Health, "waiting to be moved by hand")
    run.rig.arm.stop()
    await run.person.sees(Notice, "Press Resume in the console to go on")
    await run.person.sees(Health, "stopped")
    await run.person.presses_resume()
    await run.person.sees(Health, "waiting to be moved by hand")
    assert await jogs(run, (0.0, 0.05, 0.0)) == 12


async def test_after_a_stop_by_hand_and_another_mode_no_jog_is_heeded(run: Run) -> None:
    await run.person.chooses("teleoperate")
    await run.person.sees(Health, "waiting to be moved by hand")
    await run.person.presses_stop()
    await run.person.sees(Health, "stopped")
    await run.person.chooses("approve each")
    await run.person.presses_resume()
    await run.person.sees(Proposal)
    assert await jogs(run, (0.05, 0.0, 0.0)) == 0


async def test_a_motion_by_hand_that_is_cut_short_by_another_mode_is_on_record(run: Run) -> None:
    await run.person.chooses("teleoperate")
    await run.person.sees(Health, "waiting to be moved by hand")
    for _ in range(6):
        run.rig.arm.jog(Jog(linear=np.array([0.05, 0.0, 0.0])))
        await anyio.sleep(0.03)
    await run.person.chooses("idle")
    executed = await run.person.sees(Executed)
    assert executed.outcome == "completed"
    assert executed.measured[-1, 0] > executed.measured[0, 0]
    assert executed.id in (await run.person.sees(Transition)).cause
    await run.person.sees(Health, "idle")
    assert run.person.all(Mode)[-1].mode == "idle"
