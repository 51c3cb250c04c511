"""The checklist before a real arm moves for the first time: nothing moves until it is complete."""

from collections.abc import AsyncIterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import anyio
import numpy as np
import pytest

from app.config import KeepOut, Limits
from app.core.dialogue.approval import Approved
from app.core.dialogue.checklist import Checklist
from app.core.dialogue.control import Lease, Mode
from app.core.messages import Executed, Health, Notice, Proposal, Transition, fresh_id
from tests.session.cell import Run, for_a_while, jogs, pushes, running, small_site, small_wish, some
from tests.session.rig import SmallRig

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]

PERSONAL = ("emergency", "clear", "tool", "limits")


def day(ago: int) -> str:
    return (datetime.now(UTC).date() - timedelta(days=ago)).isoformat()


@pytest.fixture
async def real(tmp_path: Path) -> AsyncIterator[Run]:
    """A run with an arm that is real as far as the program knows, and a plan that waits for approval."""
    site = small_site(tmp_path, jog_rest_s=0.15)
    rig = SmallRig(site, simulated=False, calibrated_at=day(1))
    async with running(site, small_wish(staying=True, allow_automatic=True), rig=rig) as run:
        await run.person.sees(Proposal)
        yield run


async def tries_stop(run: Run) -> None:
    await run.person.presses_stop()
    await run.person.sees(Notice, "Stopped by tests")
    await run.person.presses_resume()
    await run.person.sees(Notice, "Resumed by tests")


async def completes(run: Run) -> None:
    await tries_stop(run)
    await run.person.confirms(*PERSONAL)
    await run.person.sees(Notice, "The checklist is complete")


def wrong(run: Run) -> dict[str, str]:
    """Reasons why items of the newest checklist are not right, by key."""
    return {item.key: item.said for item in run.person.all(Checklist)[-1].items if not item.right}


async def until(run: Run, **said: str) -> None:
    """Wait until exactly these items of the checklist are wrong, for these reasons."""
    while wrong(run).keys() != said.keys():
        await run.person.sees(Checklist)
    assert all(text in wrong(run)[key] for key, text in said.items())


async def test_no_plan_is_approved_before_the_checklist_is_complete_and_then_it_is(real: Run) -> None:
    await real.person.sees(Health, "waiting for approval")
    await real.person.decides(real.person.all(Proposal)[-1])
    refused = await real.person.sees(Notice, "Nothing moves before the checklist is complete")
    assert "STOP works" in refused.text
    assert "emergency stop" in refused.text
    assert real.rig.arm.begun == []
    await completes(real)
    assert real.person.all(Checklist)[-1].passed
    await pushes(real, await real.shows_a_plan())


async def test_every_item_has_to_be_right(real: Run) -> None:
    await real.person.confirms(*PERSONAL)
    await until(real, stop="press STOP")
    real.rig.cameras[0].broken = True
    await until(real, cameras="nothing new from", object="look at the masks", stop="press STOP")
    real.rig.cameras[0].broken = False
    real.rig.table.place = "covered"
    await until(real, object="look at the masks", stop="press STOP")
    await tries_stop(real)
    assert not real.session.store.state.passed
    real.rig.table.place = "here"
    await real.person.sees(Notice, "The checklist is complete")


async def test_nothing_moves_by_hand_before_it_is_complete(real: Run) -> None:
    await real.person.chooses("teleoperate")
    await real.person.sees(Health, "waiting for the checklist")
    assert await jogs(real, (0.05, 0.0, 0.0)) == 0
    await completes(real)
    await real.person.sees(Health, "waiting to be moved by hand")
    assert await jogs(real, (0.05, 0.0, 0.0)) > 0
    executed = await real.person.sees(Executed)
    assert np.ptp(executed.measured[:, 0]) > 0.005


async def test_a_hand_needs_nothing_of_what_the_cameras_say(tmp_path: Path) -> None:
    site = small_site(tmp_path, jog_rest_s=0.15)
    async with running(site, small_wish(staying=True), rig=SmallRig(site, simulated=False)) as run:
        await run.person.sees(Proposal)
        await run.person.chooses("teleoperate")
        await run.person.sees(Health, "waiting for the checklist")
        await tries_stop(run)
        await run.person.confirms(*PERSONAL)
        await run.person.sees(Health, "waiting to be moved by hand")
        assert set(wrong(run)) == {"calibration"}
        assert not run.session.store.state.passed
        assert await jogs(run, (0.05, 0.0, 0.0), samples=60) > 0
        await run.person.sees(Executed)
        # It was looked at while the arm moved, which is no reason to let go of the tool.
        granted = [list_.by_hand for list_ in run.person.all(Checklist)]
        assert granted == sorted(granted)
        # Where cameras stand is not known, so what they show teaches nothing.
        await anyio.sleep(0.5)
        assert not run.person.all(Transition)


async def test_whoever_has_control_confirms_all_of_it(real: Run) -> None:
    await real.person.confirms("emergency", "clear")
    await until(real, tool="", limits="", stop="")
    await real.person.asks(Lease(id=fresh_id("lease"), time_s=anyio.current_time(), holder="another", why=""))
    await until(real, emergency="", clear="", tool="", limits="", stop="")


async def test_it_has_no_other_items(real: Run) -> None:
    await real.person.confirms("everything")
    await real.person.sees(Notice, "no item 'everything'")


async def test_motions_are_made_without_approval_where_that_is_allowed_and_confirmed(real: Run) -> None:
    await real.person.chooses("automatic", 1)
    await real.person.sees(Notice, "confirm that its motions shall be made without approval")
    assert real.session.store.state.mode == "approve each"
    await real.person.chooses("automatic", 2, confirmed=True)
    await real.person.sees(Health, "waiting for the checklist")
    await real.person.confirms(*PERSONAL)
    assert not some(Approved, await for_a_while(real))
    await tries_stop(real)
    await real.person.sees(Notice, "The checklist is complete")
    assert real.session.store.state.mode == "approve each", "a stop ends what is automatic"
    await real.person.chooses("automatic", 1, confirmed=True)
    assert (await real.person.sees(Approved)).operator == "automatic"
    await real.person.sees(Mode, "the motions that were asked for are made")


async def test_a_flag_is_needed_for_that_too(tmp_path: Path) -> None:
    site = small_site(tmp_path)
    rig = SmallRig(site, simulated=False, calibrated_at=day(0))
    async with running(site, small_wish(staying=True), rig=rig) as run:
        await run.person.sees(Proposal)
        await run.person.chooses("automatic", 1, confirmed=True)
        await run.person.sees(Notice, "--allow-automatic")
        assert run.session.store.state.mode == "approve each"
        assert not some(Approved, await for_a_while(run))


@pytest.mark.parametrize(
    ("calibrated_at", "is_right"), [(day(30), True), (day(31), False), (day(-2), False), ("", False), ("May", False)]
)
async def test_cameras_were_calibrated_lately(tmp_path: Path, calibrated_at: str, is_right: bool) -> None:
    site = small_site(tmp_path)
    rig = SmallRig(site, simulated=False, calibrated_at=calibrated_at)
    async with running(site, small_wish(staying=True), rig=rig) as run:
        await run.person.sees(Checklist)
        assert ("calibration" not in wrong(run)) == is_right


async def test_a_tool_in_a_volume_that_is_kept_free_is_moved_out_first(tmp_path: Path) -> None:
    site = small_site(tmp_path)
    rig = SmallRig(site, simulated=False, calibrated_at=day(0))
    x, y, z = rig.arm.tool()[:3]
    shelf = KeepOut(name="shelf", low=(x - 0.1, y - 0.1, z - 0.1), high=(x + 0.1, y + 0.1, z + 0.1))
    site = replace(site, limits=replace(Limits(), keep_out=(shelf,)))
    async with running(site, small_wish(staying=True), rig=rig) as run:
        await run.person.sees(Checklist)
        assert "'shelf'" in wrong(run)["place"]


async def test_a_simulated_cell_asks_for_it_where_that_is_wished_alone(tmp_path: Path) -> None:
    async with running(small_site(tmp_path), small_wish(staying=True)) as run:
        await pushes(run, await run.person.sees(Proposal))
        assert run.person.all(Checklist) == []
    async with running(small_site(tmp_path), small_wish(staying=True, checklist=True)) as run:
        await run.person.sees(Checklist)
        assert "calibration" not in wrong(run)
        assert not run.session.store.state.passed
