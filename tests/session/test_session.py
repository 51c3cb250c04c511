"""Faults of people, cameras, arm and planner, and how the session takes them, in a small cell.

One run serves the whole file, as it serves an episode: each test begins with a plan of its own and leaves the run
going. Faults that end a run are in `test_ends.py`.
"""

from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.core.dialogue.approval import Approved, drift
from app.core.messages import (
    ArmState,
    Executed,
    Fault,
    Frame,
    Health,
    Notice,
    Outcome,
    Particles,
    Proposal,
)
from tests.session.cell import (
    Run,
    another_plan,
    for_a_while,
    fresh_plan,
    narrower,
    pushes,
    running,
    small_site,
    small_wish,
    some,
    withdrawn,
)
from tests.session.planner import Habits

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]


@pytest.fixture(scope="module")
async def episode(tmp_path_factory: pytest.TempPathFactory, anyio_backend: str) -> AsyncIterator[Run]:
    async with running(small_site(tmp_path_factory.mktemp("session")), small_wish()) as run:
        yield run


@pytest.fixture
async def cell(episode: Run) -> AsyncIterator[Run]:
    """The episode that goes on and on; whatever a test has moved or broken is put right after it."""
    yield episode
    episode.rig.table.place = "here"
    for camera in episode.rig.cameras:
        camera.broken = False
    await episode.plans_with(Habits())


async def test_an_approved_plan_is_made_and_scored(cell: Run) -> None:
    executed = await pushes(cell, await fresh_plan(cell))
    outcome = await cell.person.sees(Outcome)
    assert executed.outcome == "completed"
    assert executed.id in outcome.cause
    (seen,) = [each for each in cell.person.all(Particles) if each.id in outcome.cause]
    assert seen.time_s > executed.time_s, "what came of it was seen before it was over"


async def test_what_is_slow_to_rest_is_looked_at_when_it_has_come_to_rest(tmp_path: Path) -> None:
    config, settle_s = small_wish(), 3.0
    slow = replace(config.task, stage=replace(config.task.stage, settle_s=settle_s))
    async with running(small_site(tmp_path), replace(config, task=slow)) as run:
        executed = await pushes(run, await fresh_plan(run))
        outcome = await run.person.sees(Outcome)
        (seen,) = [each for each in run.person.all(Particles) if each.id in outcome.cause]
        assert seen.time_s >= executed.time_s + settle_s > executed.time_s + 10 * run.site.timing.settle_s


# Stop and resume ------------------------------------------------------------------------------------------------------


async def test_after_a_stop_nothing_is_planned_approved_or_moved_until_somebody_resumes(cell: Run) -> None:
    person, proposal = cell.person, await fresh_plan(cell)
    await person.decides(proposal)
    await person.sees(ArmState, "moving")
    await person.presses_stop()
    executed = await person.sees(Executed)
    assert executed.outcome == "stopped"

    begun = list(cell.rig.arm.begun)
    await person.decides(proposal)
    meanwhile = await for_a_while(cell)
    rest = np.array([state.pose[:3] for state in meanwhile if isinstance(state, ArmState)])
    assert len(rest) > 1
    assert np.abs(rest - executed.measured[-1, :3]).max() < 1e-6
    assert {state.mode for state in meanwhile if isinstance(state, ArmState)} == {"stopped"}
    assert not some(Proposal, meanwhile)
    assert not some(Approved, meanwhile)

    await person.presses_resume()
    again = await person.sees(Proposal)
    assert again.motion.digest() != proposal.motion.digest()
    assert cell.rig.arm.begun == begun
    assert (await pushes(cell, again)).outcome == "completed"


async def test_a_stopped_push_is_not_learned_from(cell: Run) -> None:
    person, proposal = cell.person, await fresh_plan(cell)
    scored = len(person.all(Outcome))
    await person.decides(proposal)
    await person.sees(ArmState, "moving")
    await person.presses_stop()
    await person.sees(Executed, "stopped")
    await person.presses_resume()
    await person.sees(Proposal)
    assert len(person.all(Outcome)) == scored


@pytest.mark.parametrize("decided", ["while stopped", "after Resume"])
async def test_a_plan_that_was_shown_before_a_stop_is_void_for_ever(cell: Run, decided: str) -> None:
    person, proposal = cell.person, await fresh_plan(cell)
    begun = list(cell.rig.arm.begun)
    await person.presses_stop()
    assert withdrawn(await person.sees(Notice, "was made before the stop"), proposal)
    if decided == "while stopped":
        await person.decides(proposal)
    assert not some(Approved, await for_a_while(cell))
    await person.presses_resume()
    again = await person.sees(Proposal)
    if decided == "after Resume":
        await person.decides(proposal)
        await person.sees(Notice, f"{proposal.id} is not the plan shown")
    assert cell.rig.arm.begun == begun
    assert (await pushes(cell, again)).outcome == "completed"


async def test_an_approval_given_while_stopped_is_not_kept_until_somebody_resumes(cell: Run) -> None:
    person, first = cell.person, await fresh_plan(cell)
    begun = list(cell.rig.arm.begun)
    await cell.plans_with(Habits(thinking_s=0.5))
    await person.decides(first, approve=False)
    await person.sees(Health, "planning")
    await person.presses_stop()
    made_meanwhile = await person.sees(Proposal)
    await person.decides(made_meanwhile)
    assert not some(Approved, await for_a_while(cell))
    await person.presses_resume()
    again = await person.sees(Proposal)
    await for_a_while(cell)
    assert cell.rig.arm.begun == begun, "resuming moved the arm without a decision after it"
    assert (await pushes(cell, again)).outcome == "completed"


async def test_whoever_resumes_as_soon_as_the_arm_rests_need_not_resume_twice(cell: Run) -> None:
    person = cell.person
    await person.decides(await fresh_plan(cell))
    await person.sees(ArmState, "moving")
    await person.presses_stop()
    await person.sees(ArmState, "stopped")
    await person.presses_resume()
    assert (await pushes(cell, await person.sees(Proposal))).outcome == "completed"


async def test_a_stop_that_came_after_the_request_to_resume_stays_in_force(cell: Run) -> None:
    person = cell.person
    await fresh_plan(cell)
    await person.presses_stop()
    await person.sees(Notice, "Stopped by tests")
    await person.presses_resume()
    cell.rig.arm.stop()
    await person.sees(Notice, "stopped again")
    await person.decides(person.all(Proposal)[-1])
    assert not some(Approved, await for_a_while(cell))
    await person.presses_resume()
    assert (await pushes(cell, await person.sees(Proposal))).outcome == "completed"


# Decisions ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("approve", [True, False], ids=["approval", "rejection"])
async def test_a_decision_on_an_earlier_plan_does_nothing_but_say_so(cell: Run, approve: bool) -> None:
    first = await fresh_plan(cell)
    second = await another_plan(cell, instead_of=first)
    begun = list(cell.rig.arm.begun)
    await cell.person.decides(first, approve=approve)
    notice = await cell.person.sees(Notice, f"{first.id} is not the plan shown; nothing was done")
    assert not withdrawn(notice, second)
    assert not some(Proposal, await for_a_while(cell))
    assert cell.rig.arm.begun == begun
    assert (await pushes(cell, second)).outcome == "completed"


@pytest.mark.parametrize("of_another_plan", [False, True], ids=["of no motion", "of another motion"])
async def test_an_approval_of_another_motion_than_the_one_shown_is_refused(cell: Run, of_another_plan: bool) -> None:
    first = await fresh_plan(cell)
    second = await another_plan(cell, instead_of=first)
    begun = list(cell.rig.arm.begun)
    await cell.person.decides(second, digest=first.motion.digest() if of_another_plan else "0" * 64)
    refusal = await cell.person.sees(Notice, "not the motion shown")
    assert withdrawn(refusal, second)
    third = await cell.person.sees(Proposal)
    assert not some(Approved, await for_a_while(cell))
    assert cell.rig.arm.begun == begun
    assert (await pushes(cell, third)).outcome == "completed"


async def test_an_approval_is_for_one_push_however_often_it_is_given(cell: Run) -> None:
    proposal = await fresh_plan(cell)
    begun = len(cell.rig.arm.begun)
    for _ in range(3):
        await cell.person.decides(proposal)
    for _ in range(2):
        await cell.person.sees(Notice, "is not the plan shown; nothing was done")
    await cell.person.sees(Executed)
    await for_a_while(cell)
    assert len(cell.rig.arm.begun) == begun + 1


async def test_decisions_on_nothing_that_is_shown_are_answered_however_many_and_never_keep_a_stop_waiting(
    cell: Run,
) -> None:
    person, proposal = cell.person, await fresh_plan(cell)
    for number in range(600):
        await person.decides(proposal, digest=f"{number:064x}")
    await person.presses_stop()
    await person.sees(Notice, "Stopped by tests")
    await person.presses_resume()
    assert (await pushes(cell, await person.sees(Proposal))).outcome == "completed"


async def test_a_rejected_plan_is_followed_by_one_with_other_branches(cell: Run) -> None:
    first = await fresh_plan(cell)
    await cell.person.decides(first, approve=False, reason="too near")
    assert withdrawn(await cell.person.sees(Notice, "Rejected by tests: too near"), first)
    second = await cell.person.sees(Proposal)
    for old, new in zip(first.branches, second.branches, strict=True):
        assert np.abs(old.actions - new.actions).max() > 1e-3


# An object that moves, and plans that grow old ------------------------------------------------------------------------


async def test_a_plan_for_an_object_that_has_moved_since_cannot_be_approved(cell: Run) -> None:
    person, proposal = cell.person, await fresh_plan(cell)
    limit_m, begun = cell.site.timing.plan_max_drift_m, list(cell.rig.arm.begun)
    cell.rig.table.place = "aside"
    while drift(proposal.observed, (await person.sees(Particles)).positions) < limit_m:
        pass
    await person.decides(proposal)
    assert withdrawn(await person.sees(Notice, "The object has moved by"), proposal)
    again = await person.sees(Proposal)
    assert cell.rig.arm.begun == begun
    assert drift(proposal.observed, again.observed) > limit_m
    assert (await pushes(cell, again)).outcome == "completed"


async def test_a_plan_is_dropped_where_the_object_moves_while_it_is_made(cell: Run) -> None:
    person, first = cell.person, await fresh_plan(cell)
    await cell.plans_with(Habits(thinking_s=1.5))
    await person.decides(first, approve=False)
    await person.sees(Health, "planning")
    cell.rig.table.place = "aside"
    dropped = await person.sees(Proposal)
    assert withdrawn(await person.sees(Notice, "dropped: the object moved"), dropped)
    again = await person.sees(Proposal)
    assert drift(dropped.observed, again.observed) > cell.site.timing.plan_max_drift_m
    assert (await pushes(cell, again)).outcome == "completed"


# What fails -----------------------------------------------------------------------------------------------------------


async def test_two_refusals_of_the_arm_in_a_row_are_faults_and_the_episode_goes_on(cell: Run) -> None:
    proposal = await fresh_plan(cell)
    for _ in range(2):
        begun = list(cell.rig.arm.begun)
        cell.rig.arm.obey(narrower(cell.site))
        for _ in range(2):
            await cell.person.decides(proposal)
            await cell.person.sees(Fault, "arm The motion leaves the workspace")
            proposal = await cell.person.sees(Proposal)
        assert cell.rig.arm.begun == begun
        cell.rig.arm.obey(cell.site)
        assert (await pushes(cell, proposal)).outcome == "completed"
        proposal = await cell.person.sees(Proposal)


async def test_an_object_out_of_sight_is_a_fault_and_the_episode_goes_on_once_it_is_seen(cell: Run) -> None:
    person, proposal = cell.person, await fresh_plan(cell)
    begun = list(cell.rig.arm.begun)
    cell.rig.table.place = "covered"
    await person.sees(Fault, "perception")
    while (await person.sees(Health)).particles_age_s < cell.site.timing.object_unseen_s:
        pass
    await person.decides(proposal)
    assert withdrawn(await person.sees(Notice, "The object was last seen"), proposal)
    await person.sees(Health, "looking at the object")
    assert not some(Proposal, await for_a_while(cell))
    assert cell.rig.arm.begun == begun
    cell.rig.table.place = "here"
    assert (await pushes(cell, await person.sees(Proposal))).outcome == "completed"


async def test_a_camera_that_gives_nothing_is_a_fault_and_is_read_again(cell: Run) -> None:
    person, camera = cell.person, cell.rig.cameras[0]
    await fresh_plan(cell)
    camera.broken = True
    fault = await person.sees(Fault, f"camera {camera.model.name}")
    assert "check its cable" in fault.text
    while camera.model.name not in (health := await person.sees(Health)).cameras:
        pass
    assert health.cameras == {camera.model.name: "its cable is loose"}
    assert (await person.sees(Frame)).camera.name != camera.model.name, "the other one is still read"
    camera.broken = False
    while (await person.sees(Frame)).camera.name != camera.model.name:
        pass
    assert (await pushes(cell, await fresh_plan(cell))).outcome == "completed"


async def test_two_plans_that_fail_in_a_row_are_faults_and_the_third_is_shown(cell: Run) -> None:
    person, first = cell.person, await fresh_plan(cell)
    await cell.plans_with(Habits(failures=2))
    await person.decides(first, approve=False)
    for _ in range(2):
        await person.sees(Fault, "planner No branch stayed finite")
    assert (await pushes(cell, await person.sees(Proposal))).outcome == "completed"
