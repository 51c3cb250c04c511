"""Modes of the program: what it does by itself in each and what it leaves alone; goals that come while it runs."""

from collections.abc import AsyncIterator

import anyio
import numpy as np
import pytest

from app.core.dialogue.approval import Approved
from app.core.dialogue.control import EndRequest, Lease, Mode
from app.core.dialogue.requests import GoalRequest, GoalSource, PictureGoalRequest
from app.core.messages import (
    ArmState,
    Decision,
    Executed,
    Fault,
    Frame,
    Goal,
    Health,
    Notice,
    Particles,
    Proposal,
    fresh_id,
)
from tests.session.cell import Run, for_a_while, pushes, running, small_site, small_wish, some, withdrawn
from tests.session.planner import Habits

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]


@pytest.fixture(scope="module")
async def session(tmp_path_factory: pytest.TempPathFactory, anyio_backend: str) -> AsyncIterator[Run]:
    async with running(small_site(tmp_path_factory.mktemp("session")), small_wish(staying=True)) as run:
        await run.person.sees(Proposal)
        yield run


@pytest.fixture
async def idle(session: Run) -> Run:
    """The session, told to do nothing."""
    session.person.look_away()
    await session.person.chooses("idle")
    await session.person.sees(Mode, "idle")
    await session.person.sees(Health, "idle")
    session.rig.table.place = "here"
    await session.plans_with(Habits())
    return session


async def test_idle_it_plans_nothing_and_moves_nothing(idle: Run) -> None:
    begun = list(idle.rig.arm.begun)
    meanwhile = await for_a_while(idle)
    assert some(Particles, meanwhile), "it does not look any more"
    assert not some(Proposal, meanwhile)
    assert idle.rig.arm.begun == begun


async def test_a_plan_that_waits_for_approval_is_void_in_another_mode(idle: Run) -> None:
    person = idle.person
    await person.chooses("approve each")
    proposal = await person.sees(Proposal)
    await person.sees(Health, "waiting for approval")
    await person.chooses("idle")
    assert withdrawn(await person.sees(Notice, "was made in another mode"), proposal)
    begun = list(idle.rig.arm.begun)
    await person.decides(proposal)
    assert not some(Approved, await for_a_while(idle))
    assert idle.rig.arm.begun == begun


async def test_plans_that_are_only_shown_cannot_be_approved_and_follow_the_object(idle: Run) -> None:
    person = idle.person
    await person.chooses("plan only")
    proposal = await person.sees(Proposal)
    await person.sees(Health, "showing a plan")
    begun = list(idle.rig.arm.begun)
    await person.decides(proposal)
    assert not some(Approved, await for_a_while(idle))
    idle.rig.table.place = "aside"
    assert withdrawn(await person.sees(Notice, "the object moved by"), proposal)
    again = await person.sees(Proposal)
    assert again.id != proposal.id
    assert idle.rig.arm.begun == begun


async def test_so_many_motions_are_made_automatically_and_no_more(idle: Run) -> None:
    person, begun = idle.person, len(idle.rig.arm.begun)
    await person.chooses("automatic", 2)
    counted = [(await person.sees(Mode)).motions for _ in range(3)]
    assert counted == [2, 1, 0]
    last = person.all(Mode)[-1]
    assert (last.mode, last.why) == ("approve each", "the motions that were asked for are made")
    assert len(idle.rig.arm.begun) == begun + 2
    assert {message.operator for message in person.all(Decision)[-2:]} == {"automatic"}
    await person.sees(Health, "waiting for approval")
    await for_a_while(idle)
    assert len(idle.rig.arm.begun) == begun + 2


@pytest.mark.parametrize("motions", [0, -1, 10**6])
async def test_an_impossible_number_of_automatic_motions_changes_nothing(idle: Run, motions: int) -> None:
    await idle.person.chooses("automatic", motions)
    await idle.person.sees(Notice, "automatic is for 1 to 1000")
    assert idle.session.store.state.mode == "idle"


async def test_a_stop_ends_what_is_automatic_also_after_it_is_lifted(idle: Run) -> None:
    person = idle.person
    await person.chooses("automatic", 100)
    await person.sees(Executed)
    await person.presses_stop()
    await person.sees(Mode, "the arm was stopped")
    await person.presses_resume()
    await person.sees(Health, "waiting for approval")
    begun = list(idle.rig.arm.begun)
    await for_a_while(idle)
    assert idle.rig.arm.begun == begun


async def test_automatic_ends_when_whoever_asked_for_it_has_no_control_any_more(idle: Run) -> None:
    person = idle.person
    await person.chooses("automatic", 100)
    await person.sees(Executed)
    await person.asks(Lease(id=fresh_id("lease"), time_s=anyio.current_time(), holder="", why="tests have left"))
    await person.sees(Mode, "tests has no control any more")
    await person.sees(Health, "waiting for approval")


async def test_what_was_rejected_is_told_to_the_planner_until_something_moves(idle: Run) -> None:
    person, costs = idle.person, list[float]()
    await person.chooses("approve each")
    for _ in range(3):
        proposal = await person.sees(Proposal)
        costs.append(proposal.chosen.cost_after)
        await person.decides(proposal, approve=False)
    await pushes(idle, await person.sees(Proposal))
    costs.append((await person.sees(Proposal)).chosen.cost_after)
    assert costs == [-10.0, -9.0, -8.0, -10.0]


async def test_where_the_rope_was_predicted_is_told_to_the_planner_until_it_may_lie_elsewhere(idle: Run) -> None:
    """And how the plan was to go on until the next one is decided on."""
    person = idle.person
    await person.chooses("approve each")
    first = await person.sees(Proposal)
    await pushes(idle, first)
    then = {"near": float(first.chosen.tool_path[0, 0])}
    continued = then | {"remainder": then["near"]}
    rejected = await person.sees(Proposal)
    await person.decides(rejected, approve=False)
    stopped = await person.sees(Proposal)
    await person.decides(stopped)
    await person.sees(ArmState, "moving")
    await person.presses_stop()
    await person.sees(Executed, "stopped")
    await person.presses_resume()
    assert (rejected.chosen.terms, stopped.chosen.terms) == (continued, then)
    assert (await person.sees(Proposal)).chosen.terms == {}


async def test_what_fails_leads_to_idle_and_the_session_goes_on(idle: Run) -> None:
    person = idle.person
    await idle.plans_with(Habits(failures=3))
    await person.chooses("approve each")
    await person.sees(Fault, "No branch stayed finite")
    await person.sees(Mode, "something failed")
    await person.chooses("approve each")
    assert (await pushes(idle, await person.sees(Proposal))).outcome == "completed"


# Goals ----------------------------------------------------------------------------------------------------------------


def goal_request(positions: np.ndarray, source: GoalSource = "copy") -> GoalRequest:
    return GoalRequest(
        id=fresh_id("goal"),
        time_s=anyio.current_time(),
        operator="tests",
        source=source,
        positions=positions.astype(np.float32),
    )


async def test_a_goal_that_is_given_voids_the_plan_and_is_planned_for(idle: Run) -> None:
    person = idle.person
    await person.chooses("approve each")
    proposal = await person.sees(Proposal)
    await person.sees(Health, "waiting for approval")
    request = goal_request(proposal.observed + np.array([0.0, 0.1, 0.0]))
    await person.asks(request)
    goal = await person.sees(Goal)
    assert goal.cause == (request.id,)
    np.testing.assert_array_equal(goal.positions, request.positions)
    assert withdrawn(await person.sees(Notice, "is for another goal"), proposal)
    assert (await person.sees(Proposal)).goal_id == goal.id


async def test_a_plan_for_another_goal_does_not_go_on_with_the_one_before(idle: Run) -> None:
    person = idle.person
    await person.chooses("approve each")
    await pushes(idle, await person.sees(Proposal))
    continued = await person.sees(Proposal)
    await person.asks(goal_request(continued.observed + np.array([0.0, 0.1, 0.0])))
    await person.sees(Notice, "is for another goal")
    assert "remainder" in continued.chosen.terms
    assert "remainder" not in (await person.sees(Proposal)).chosen.terms


async def test_a_goal_that_is_given_while_the_arm_moves_ends_what_is_left_of_the_plan(idle: Run) -> None:
    person = idle.person
    await person.chooses("approve each")
    first = await person.sees(Proposal)
    await person.decides(first)
    await person.sees(ArmState, "moving")
    await person.asks(goal_request(first.observed + np.array([0.0, 0.1, 0.0])))
    goal = await person.sees(Goal)
    await person.sees(Executed, "completed")
    following = await person.sees(Proposal)
    assert following.goal_id == goal.id
    assert "remainder" not in following.chosen.terms


async def test_where_the_view_is_the_goal_it_is_reached_and_the_session_waits(idle: Run) -> None:
    person = idle.person
    seen = await person.sees(Particles)
    await person.asks(goal_request(seen.positions, "view"))
    await person.sees(Goal)
    await person.chooses("approve each")
    await person.sees(Mode, "the goal is reached")
    await person.asks(goal_request(seen.positions + np.array([0.0, 0.1, 0.0])))
    await person.sees(Goal)


@pytest.mark.parametrize(
    ("shift", "says"),
    [((0.0, 0.5, 0.0), "outside the workspace"), ((0.0, 0.0, 0.2), "out of reach"), ((0.0, np.nan, 0.0), "outside")],
)
async def test_a_goal_that_cannot_be_is_refused_in_words(idle: Run, shift: tuple[float, ...], says: str) -> None:
    goals = len(idle.person.all(Goal))
    seen = await idle.person.sees(Particles)
    await idle.person.asks(goal_request(seen.positions + np.array(shift)))
    assert "The moved copy as goal" in (await idle.person.sees(Notice, says)).text
    assert len(idle.person.all(Goal)) == goals


async def test_a_pair_of_pictures_is_a_goal_where_the_object_is_in_them(idle: Run) -> None:
    frame = await idle.person.sees(Frame)
    fields = {"id": fresh_id("goal"), "time_s": anyio.current_time(), "operator": "tests", "camera": frame.camera.name}
    await idle.person.asks(PictureGoalRequest(**fields, color=frame.color, depth=frame.depth))
    goal = await idle.person.sees(Goal)
    # One camera does not see all of it: the arm stands before a part.
    assert np.abs(goal.positions[:, [0, 2]] - (0.54, 0.008)).max() < 0.012
    assert np.ptp(goal.positions[:, 1]) > 0.36
    await idle.person.asks(PictureGoalRequest(**fields, color=frame.color, depth=0 * frame.depth))
    await idle.person.sees(Notice, "has no reading")
    await idle.person.asks(PictureGoalRequest(**fields, color=frame.color[::2], depth=frame.depth[::2]))
    await idle.person.sees(Notice, "take both with it")


async def test_somebody_ends_the_session(tmp_path) -> None:
    async with running(small_site(tmp_path), small_wish(staying=True)) as run:
        await run.person.sees(Proposal)
        await run.person.asks(EndRequest(id=fresh_id("end"), time_s=anyio.current_time(), operator="tests"))
        assert await run.end() is None
