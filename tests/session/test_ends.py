"""Ends of a session, and the errors that they give; each test has a run of its own, in a small cell."""

from dataclasses import replace
from pathlib import Path

import anyio
import numpy as np
import pytest

from app.core.dialogue.approval import Approved
from app.core.dialogue.control import Mode
from app.core.dialogue.model_monitor_messages import Watched
from app.core.errors import DeviceError, MotionRefused, PlanningError
from app.core.messages import ArmState, Executed, Fault, Notice, Outcome, Proposal, ResumeRequest, Transition
from app.tasks.elements.curves import fill_tube
from app.tasks.elements.success import Near
from tests.session.cell import Run, for_a_while, narrower, running, small_site, small_wish, some, withdrawn
from tests.session.planner import Habits
from tests.session.rig import SmallRig

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]


async def test_a_plan_that_grew_too_old_is_withdrawn_and_cannot_be_approved_any_more(tmp_path: Path) -> None:
    async with running(small_site(tmp_path, plan_max_age_s=0.8), small_wish()) as run:
        old = await run.person.sees(Proposal)
        assert withdrawn(await run.person.sees(Notice, "grew too old; planning again"), old)
        new = await run.person.sees(Proposal)
        assert new.time_s > old.time_s
        await run.person.decides(old)
        await run.person.sees(Notice, f"{old.id} is not the plan shown")
        assert not some(Approved, await for_a_while(run))
        assert run.rig.arm.begun == []


async def test_the_third_refusal_in_a_row_ends_the_run_with_what_the_arm_says(tmp_path: Path) -> None:
    async with running(small_site(tmp_path), small_wish()) as run:
        run.rig.arm.obey(narrower(run.site))
        for _ in range(3):
            await run.person.decides(await run.person.sees(Proposal))
        error = await run.end()
        assert isinstance(error, MotionRefused)
        assert "leaves the workspace" in str(error)
        assert [fault.fatal for fault in run.person.all(Fault)] == [False, False, False, True]
        assert run.rig.arm.begun == []


async def test_an_object_that_stays_out_of_sight_ends_the_run_with_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running(small_site(tmp_path), small_wish()) as run:
        proposal = await run.person.sees(Proposal)
        run.rig.table.place = "covered"
        await run.person.sees(Fault, "perception")
        monkeypatch.setattr("app.session.perception_stage._OBSERVE_DEADLINE_S", 0.5)
        await run.person.decides(proposal, approve=False)
        error = await run.end()
        assert isinstance(error, DeviceError)
        assert "uncover the object, and start again" in str(error)


async def test_three_plans_that_fail_in_a_row_end_the_run(tmp_path: Path) -> None:
    async with running(small_site(tmp_path), small_wish(), habits=Habits(failures=3)) as run:
        error = await run.end()
        assert isinstance(error, PlanningError)
        assert "No branch stayed finite" in str(error)
        assert [fault.fatal for fault in run.person.all(Fault)] == [False, False, False, True]


async def test_automatic_approval_is_refused_where_something_real_can_move(tmp_path: Path) -> None:
    site = small_site(tmp_path)
    with pytest.raises(MotionRefused, match="simulated rig alone"):
        Run(small_wish(automatic=True), site, SmallRig(site, simulated=False))
    Run(small_wish(automatic=True), site, SmallRig(site, simulated=True))
    Run(small_wish(automatic=False), site, SmallRig(site, simulated=False))


async def test_an_automatic_run_makes_its_pushes_and_records_everything_it_shows(tmp_path: Path) -> None:
    async with running(small_site(tmp_path), small_wish(pushes=2, automatic=True)) as run:
        assert await run.end() is None
        assert [executed.outcome for executed in run.person.all(Executed)] == ["completed"] * 2
        assert run.session.summary.pushes == 2
        assert not run.session.summary.reached
        assert run.log.messages == run.person.seen
        assert run.session.summary.said == len(run.log.messages)


async def test_an_automatic_run_ends_where_the_goal_is_reached(tmp_path: Path) -> None:
    config = small_wish(automatic=True)
    near = replace(config, task=replace(config.task, stop_when=Near(limit_m2=1.0)))
    async with running(small_site(tmp_path), near) as run:
        assert await run.end() is None
        assert run.session.summary.reached
        assert run.session.summary.pushes == 0


async def test_an_automatic_run_ends_where_no_motion_is_better_than_none(tmp_path: Path) -> None:
    async with running(small_site(tmp_path), small_wish(automatic=True), habits=Habits(cost=0.0)) as run:
        assert await run.end() is None
        assert run.session.summary.exhausted
        assert len(run.person.all(Proposal)) == len({proposal.id for proposal in run.person.all(Proposal)}) == 2
        assert run.rig.arm.begun == []


@pytest.mark.parametrize(
    ("share", "terms", "pushes"),
    [(0.005, {}, 0), (0.3, {}, 2), (0.3, {"progress": -0.1}, 2), (0.3, {"progress": 0.1}, 0)],
)
async def test_an_automatic_run_makes_motions_that_promise_enough_whatever_contact_costs(
    tmp_path: Path, share: float, terms: dict[str, float], pushes: int
) -> None:
    config = small_wish(pushes=2, automatic=True)
    async with running(small_site(tmp_path), config, habits=Habits(cost=0.1, share=share, terms=terms)) as run:
        assert await run.end() is None
        assert (run.session.summary.pushes, run.session.summary.exhausted) == (pushes, pushes == 0)


async def test_a_session_that_goes_on_by_itself_waits_where_no_motion_is_better_than_none(tmp_path: Path) -> None:
    async with running(small_site(tmp_path), small_wish(staying=True), habits=Habits(cost=0.0)) as run:
        await run.person.chooses("automatic", 5)
        assert (await run.person.sees(Mode, "no motion promises")).mode == "idle"
        await run.person.chooses("approve each")
        await run.person.decides(await run.person.sees(Proposal))
        assert (await run.person.sees(Executed)).outcome == "completed"


async def test_where_what_is_seen_does_not_answer_a_push_is_scored_and_nothing_learned(tmp_path: Path) -> None:
    config = replace(small_wish(pushes=1, automatic=True), answering=False)
    async with running(small_site(tmp_path), config) as run:
        assert await run.end() is None
        assert len(run.person.all(Outcome)) == run.session.summary.pushes == 1
        assert not some(Transition, run.person.seen)
        assert not some(Watched, run.person.seen)


async def test_an_automatic_run_that_was_stopped_ends_where_nobody_resumes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.session.state.UNATTENDED_S", 0.5)
    async with running(small_site(tmp_path), small_wish(automatic=True)) as run:
        await run.person.sees(ArmState, "moving")
        await run.person.presses_stop()
        error = await run.end()
        assert isinstance(error, DeviceError)
        assert "nobody pressed Resume" in str(error)
        begun = len(run.rig.arm.begun)
        await anyio.sleep(0.2)
        assert len(run.rig.arm.begun) == begun


async def test_an_automatic_run_goes_on_by_itself_where_only_the_arm_ended_a_motion(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.session.state.PAUSE_S", 0.3)
    async with running(small_site(tmp_path), small_wish(pushes=2, automatic=True)) as run:
        await run.person.sees(ArmState, "moving")
        run.rig.arm.trips()
        assert await run.end() is None
        assert [executed.outcome for executed in run.person.all(Executed)] == ["stopped", "completed", "completed"]
        assert [request.operator for request in run.person.all(ResumeRequest)] == ["the run"]
        assert run.session.summary.pushes == 2


async def test_an_automatic_run_that_the_arm_stops_again_and_again_waits_for_somebody(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.session.state.PAUSE_S", 0.1)
    monkeypatch.setattr("app.session.state.UNATTENDED_S", 0.5)
    async with running(small_site(tmp_path), small_wish(automatic=True)) as run:
        for _ in range(4):
            await run.person.sees(ArmState, "moving")
            run.rig.arm.trips()
            await run.person.sees(Executed, "stopped")
        error = await run.end()
        assert isinstance(error, DeviceError)
        assert len(run.rig.arm.begun) == 4


async def test_a_stop_that_somebody_presses_as_an_automatic_run_pauses_is_not_lifted_by_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.session.state.PAUSE_S", 0.5)
    monkeypatch.setattr("app.session.state.UNATTENDED_S", 1.5)
    async with running(small_site(tmp_path), small_wish(automatic=True)) as run:
        await run.person.sees(ArmState, "moving")
        run.rig.arm.trips()
        await run.person.sees(Notice, "goes on by itself")
        await run.person.presses_stop()
        error = await run.end()
        assert isinstance(error, DeviceError)
        assert "nobody pressed Resume" in str(error)
        assert not run.person.all(ResumeRequest)
        assert len(run.rig.arm.begun) == 1


async def test_a_stop_that_somebody_pressed_is_not_lifted_by_an_automatic_run_before_it_heard_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.session.state.PAUSE_S", 0.3)
    monkeypatch.setattr("app.session.state.UNATTENDED_S", 1.0)
    for tripped in (False, True):
        async with running(small_site(tmp_path), small_wish(automatic=True)) as run:
            await run.person.sees(ArmState, "moving")
            if tripped:
                run.rig.arm.trips()
                await run.person.sees(Notice, "goes on by itself")
            run.rig.arm.stop()
            assert isinstance(await run.end(), DeviceError)
            assert not run.person.all(ResumeRequest)
            assert len(run.rig.arm.begun) == 1


async def test_where_cameras_err_the_goal_is_reached_when_they_show_what_they_would_show_there(tmp_path: Path) -> None:
    config = small_wish()
    y = np.linspace(-0.2, 0.2, 41)
    here = fill_tube(np.stack([np.full_like(y, 0.54), y, np.full_like(y, 0.008)], axis=1), 0.008, 60)
    async with running(small_site(tmp_path), replace(config, shown_goal=here)) as run:
        assert await run.end() is None
        assert run.session.summary.pushes == 0
        assert run.session.summary.chamfer_m2[0] < config.task.success.limit_m2
        assert run.rig.arm.begun == []
