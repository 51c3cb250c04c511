"""Motions that an operator asks for: the start pose, and what was demonstrated; each is approved like a plan."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Literal, final

import anyio
import numpy as np
import pytest

from app.arm.gate import check_motion, way
from app.config import Site
from app.core.dialogue.control import Mode
from app.core.dialogue.requests import DemonstrationRequest, EditRequest, HandRequest, StartPoseRequest, is_requested
from app.core.errors import MotionRefused, PlanningError, UsageError
from app.core.messages import Executed, Health, Message, Notice, Outcome, Proposal, Transition, fresh_id
from app.core.motion import TOOL_DOWN
from app.session.requests.requested_motions import demonstrated_motion, join_motions, require_same_scene, way_to
from tests.session.cell import Run, for_a_while, fresh_plan, jogs, pushes, running, small_site, small_wish, some
from tests.ui import synthetic

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]


@final
class Shelf:
    """A studio with one demonstration, and no other files."""

    def __init__(self) -> None:
        self.shown: list[Transition] = []
        self.task = "rope_push"

    async def begin(self, opening: Callable[[], Sequence[Message]]) -> Path:
        return Path("none.mcap")

    async def end(self, said: Literal["success", "failure"] | None, *, operator: str) -> None:
        return None

    async def demonstration(self, recording: str) -> tuple[str, Sequence[Transition]]:
        if recording != "shown.mcap":
            raise UsageError(f"There is no demonstration {recording!r}; name a file of that folder.")
        return self.task, self.shown

    async def clip(self, duration_s: float) -> Path:
        return Path("none.mcap")


def start_pose() -> StartPoseRequest:
    return StartPoseRequest(id=fresh_id("start"), time_s=anyio.current_time(), operator="tests")


def demonstration(recording: str = "shown.mcap") -> DemonstrationRequest:
    return DemonstrationRequest(
        id=fresh_id("again"), time_s=anyio.current_time(), operator="tests", recording=recording
    )


async def takes_over(run: Run) -> None:
    """Stop the arm and ask for it by hand, as the console does."""
    run.rig.arm.stop()
    await run.person.asks(HandRequest(id=fresh_id("hand"), time_s=anyio.current_time(), operator="tests", act="take"))


async def gives_back(run: Run) -> None:
    await run.person.asks(HandRequest(id=fresh_id("hand"), time_s=anyio.current_time(), operator="tests", act="give"))


async def test_the_way_to_the_start_pose_is_a_proposal_that_is_approved_made_and_not_learned_from(
    tmp_path: Path,
) -> None:
    async with running(small_site(tmp_path), small_wish(staying=True)) as run:
        person, start = run.person, run.rig.arm.tool()
        await pushes(run, await run.shows_a_plan())
        await person.sees(Outcome)
        await run.shows_a_plan()
        assert np.linalg.norm((run.rig.arm.tool() - start)[:3]) > 0.05
        learned = len(person.all(Transition))
        await person.asks(start_pose())
        await person.sees(Notice, "gives way to what was asked for")
        proposal = await person.sees(Proposal)
        assert (proposal.chosen.origin, is_requested(proposal)) == ("start", True)
        np.testing.assert_allclose(proposal.motion.positions[-1], start[:3])
        executed = await pushes(run, proposal)
        assert executed.outcome == "completed"
        np.testing.assert_allclose(run.rig.arm.tool()[:7], start[:7], atol=2e-3)
        plan = await person.sees(Proposal)
        assert not is_requested(plan)
        assert len(person.all(Outcome)) == 1
        assert len(person.all(Transition)) == learned
        # It is there.
        await person.asks(start_pose())
        await person.sees(Notice, "The tool is at the start pose")


async def test_a_session_at_rest_rests_again_after_what_was_asked_for(tmp_path: Path) -> None:
    async with running(small_site(tmp_path), small_wish(staying=True)) as run:
        person = run.person
        await pushes(run, await run.shows_a_plan())
        await person.sees(Outcome)
        for approve, said in ((False, "is given up"), (True, "is made")):
            await person.chooses("idle")
            await person.sees(Health, "idle")
            await person.asks(start_pose())
            await person.sees(Mode, "approve each")
            proposal = await person.sees(Proposal)
            await person.decides(proposal, approve=approve)
            await person.sees(Mode, said)
            assert not some(Proposal, await for_a_while(run))


async def test_nothing_is_offered_where_motions_are_not_approved_one_by_one(tmp_path: Path) -> None:
    async with running(small_site(tmp_path), small_wish(staying=True)) as run:
        await pushes(run, await run.shows_a_plan())
        await run.person.sees(Outcome)
        await run.person.chooses("automatic", motions=3)
        await run.person.sees(Mode, "automatic")
        await run.person.asks(start_pose())
        await run.person.sees(Notice, "Choose 'Approve each' first")


async def test_a_stop_and_another_goal_end_what_was_asked_for_and_it_is_not_edited(tmp_path: Path) -> None:
    async with running(small_site(tmp_path), small_wish(staying=True)) as run:
        person = run.person
        await pushes(run, await run.shows_a_plan())
        await person.sees(Outcome)
        await run.shows_a_plan()
        await person.asks(start_pose())
        proposal = await person.sees(Proposal)
        await person.sees(Health, "waiting for approval")
        ends = {"start": np.array([0.4, 0.0, 0.02]), "end": np.array([0.45, 0.0, 0.02])}
        edit = EditRequest(
            id=fresh_id("edit"), time_s=anyio.current_time(), operator="tests", proposal_id=proposal.id, **ends
        )
        await person.asks(edit)
        await person.sees(Notice, "is made as it is, or not at all")
        await person.presses_stop()
        await person.sees(Notice, "Press Resume")
        await person.presses_resume()
        assert not is_requested(await person.sees(Proposal))


async def test_a_demonstration_is_made_again_motion_by_motion_and_learned_from(tmp_path: Path) -> None:
    shelf = Shelf()
    async with running(small_site(tmp_path), small_wish(staying=True), studio=shelf) as run:
        person = run.person
        for _ in range(2):
            await pushes(run, await fresh_plan(run))
            shelf.shown.append(await person.sees(Transition))
        scored = len(person.all(Outcome))
        await run.shows_a_plan()
        await person.asks(demonstration())
        for shown in shelf.shown:
            proposal = await person.sees(Proposal)
            assert proposal.chosen.origin == "shown"
            check_motion(proposal.motion, proposal.motion.digest(), run.site)
            executed = await pushes(run, proposal)
            made, before = executed.commanded[:, :3], shown.executed.commanded[:, :3]
            apart = np.linalg.norm(made[:, None] - before[None], axis=-1).min(axis=0)
            low = before[:, 2] < 0.03
            assert apart[low].max() < 2e-3, "the part that could touch the object is made as it was"
            transition = await person.sees(Transition)
            assert executed.id in transition.cause
        assert not is_requested(await person.sees(Proposal))
        assert len(person.all(Outcome)) <= scored + 1


async def test_a_demonstration_of_something_else_or_with_the_object_elsewhere_is_refused_in_words(
    tmp_path: Path,
) -> None:
    shelf = Shelf()
    async with running(small_site(tmp_path), small_wish(staying=True), studio=shelf) as run:
        person = run.person
        await person.sees(Proposal)
        await person.asks(demonstration("../none.mcap"))
        await person.sees(Notice, "There is no demonstration")
        await person.asks(demonstration())
        await person.sees(Notice, "holds no motion")
        await pushes(run, await run.shows_a_plan())
        shelf.shown.append(await person.sees(Transition))
        shelf.task = "cloth_hang"
        await person.asks(demonstration())
        await person.sees(Notice, "is of cloth_hang, and this session of rope_push")
        shelf.task = "rope_push"
        run.rig.table.place = "aside"
        await for_a_while(run)
        await person.asks(demonstration())
        notice = await person.sees(Notice, "from where it lay in the demonstration")
        assert "+40 mm along x" in notice.text
        assert "lay it as it was shown" in notice.text
    async with running(small_site(tmp_path), small_wish(staying=True)) as run:
        await run.person.sees(Proposal)
        await run.person.asks(demonstration())
        await run.person.sees(Notice, "not recorded")


async def test_what_is_laid_otherwise_between_two_motions_ends_a_demonstration(tmp_path: Path) -> None:
    shelf = Shelf()
    async with running(small_site(tmp_path), small_wish(staying=True), studio=shelf) as run:
        person = run.person
        for _ in range(2):
            await pushes(run, await fresh_plan(run))
            shelf.shown.append(await person.sees(Transition))
        await run.shows_a_plan()
        await person.asks(demonstration())
        await pushes(run, await person.sees(Proposal))
        run.rig.table.place = "aside"
        await person.sees(Notice, "What you asked for ends here")
        assert not is_requested(await person.sees(Proposal))


async def test_a_hand_takes_over_in_mid_motion_moves_the_tool_and_gives_back(tmp_path: Path) -> None:
    async with running(small_site(tmp_path, jog_rest_s=0.15), small_wish(staying=True)) as run:
        person, arm = run.person, run.rig.arm
        await person.decides(await run.shows_a_plan())
        await person.sees(Health, "pushing")
        await anyio.sleep(0.3)
        assert (await arm.state()).mode == "moving"
        await takes_over(run)
        executed = await person.sees(Executed)
        assert executed.outcome == "stopped"
        await person.sees(Notice, "The tool heeds the hand of tests now")
        await person.sees(Health, "waiting to be moved by hand")
        assert await jogs(run, (0.0, 0.0, 0.05)) == 12
        assert (await person.sees(Executed)).outcome == "completed"
        await person.sees(Health, "waiting to be moved by hand")
        await gives_back(run)
        mode = await person.sees(Mode, "approve each")
        assert "gave it back" in mode.why
        assert not is_requested(await person.sees(Proposal))
        assert not person.all(Outcome), "a motion that was not made to its end is not scored"
        await gives_back(run)
        await person.sees(Notice, "there is nothing to give back")


async def test_motions_without_approval_end_where_a_hand_takes_over(tmp_path: Path) -> None:
    async with running(small_site(tmp_path, jog_rest_s=0.15), small_wish(staying=True)) as run:
        person = run.person
        await run.shows_a_plan()
        await person.chooses("automatic", motions=5)
        await person.sees(Health, "pushing")
        await anyio.sleep(0.3)
        await takes_over(run)
        await person.sees(Health, "waiting to be moved by hand")
        await gives_back(run)
        await person.sees(Mode, "approve each")
        proposal = await person.sees(Proposal)
        assert not some(Executed, await for_a_while(run)), "it waits for approval"
        await pushes(run, proposal)


async def test_a_stop_after_a_hand_took_over_holds_until_somebody_resumes(tmp_path: Path) -> None:
    async with running(small_site(tmp_path, jog_rest_s=0.15), small_wish(staying=True)) as run:
        person = run.person
        await person.decides(await run.shows_a_plan())
        await person.sees(Health, "pushing")
        await anyio.sleep(0.3)
        await takes_over(run)
        await person.presses_stop()
        await person.sees(Notice, "Press Resume")
        assert await jogs(run, (0.0, 0.0, 0.05), samples=4) == 0
        assert run.rig.arm.held
        await takes_over(run)
        await person.sees(Notice, "A stop is in force: press Resume, then choose 'By hand'")
        await person.presses_resume()
        await person.sees(Health, "waiting to be moved by hand")
        assert await jogs(run, (0.0, 0.0, 0.05)) == 12


def test_the_way_to_a_pose_goes_up_across_and_down_and_never_onto_the_object(tmp_path: Path) -> None:
    site = small_site(tmp_path)
    start, tool = np.array([0.4, 0.1, 0.06, *TOOL_DOWN, 0.0]), np.array([0.6, -0.1, 0.05, *TOOL_DOWN, 0.02])
    motion = way_to(start, tool, None, site)
    assert motion.continues
    np.testing.assert_allclose(motion.positions[:, 2], [0.05, site.travel_height_m, site.travel_height_m, 0.06])
    assert (motion.openings == 0.02).all(), "what is held stays held"
    assert (motion.speeds <= site.limits.speed_m_s).all()
    way(tool, motion, site)
    object_ = np.array([[0.41, 0.1, 0.05]], np.float32)
    with pytest.raises(PlanningError, match="The object lies at the start pose"):
        way_to(start, tool, object_, site)
    way_to(start, tool, object_ - np.float32([0.0, 0.2, 0.0]), site)
    with pytest.raises(MotionRefused, match="outside-workspace"):
        way_to(np.array([0.1, 0.1, 0.06, *TOOL_DOWN, 0.0]), tool, None, site)


def test_a_motion_by_hand_is_made_again_along_its_corners_at_its_own_speed(tmp_path: Path) -> None:
    site, rng = small_site(tmp_path), np.random.default_rng(0)
    corners = np.array([[0.4, 0.0, 0.05], [0.4, 0.0, 0.02], [0.5, 0.05, 0.02], [0.5, 0.05, 0.05]])
    path = np.concatenate([np.linspace(a, b, 50) for a, b in pairwise(corners)])
    path = np.concatenate([path[:60], np.repeat(path[60:61], 40, axis=0), path[60:]])
    path += rng.normal(0.0, 5e-5, path.shape)
    commanded = np.concatenate([path, np.tile(TOOL_DOWN, (len(path), 1))], axis=1)
    times_s = 0.02 * np.arange(len(path))
    executed = Executed(
        id=fresh_id("executed"),
        time_s=float(times_s[-1]),
        approved_id=fresh_id("jogged"),
        outcome="completed",
        reason="",
        times_s=times_s,
        commanded=commanded,
        measured=commanded,
    )
    for tool, continues in ((commanded[0], True), (commanded[-1], False)):
        motion = demonstrated_motion(executed, np.append(tool, 0.0), site)
        check_motion(motion, motion.digest(), site)
        assert motion.continues is continues
        assert len(motion.positions) < 30
        # Between its corners no point of the path is left by half a millimetre.
        fine = np.concatenate(
            [np.linspace(a, b, 200) for a, b in zip(motion.positions[:-1], motion.positions[1:], strict=True)]
        )
        assert np.linalg.norm(path[:, None] - fine[None], axis=-1).min(axis=1).max() < 6e-4
        # A hand that paused is no slower for it.
        longest = int(np.linalg.norm(np.diff(motion.positions, axis=0), axis=1).argmax()) + 1
        assert motion.speeds[longest] == pytest.approx(0.11 / (50 * 0.02), rel=0.3)


def test_what_a_hand_holds_between_two_motions_is_not_let_go() -> None:
    site = small_site(Path())

    def moved(start: list[float], end: list[float], begin_s: float) -> Transition:
        path = np.linspace(start, end, 20)
        commanded = np.concatenate([path, np.tile(TOOL_DOWN, (20, 1))], axis=1)
        executed = Executed(
            id=fresh_id("executed"),
            time_s=begin_s + 0.38,
            approved_id=fresh_id("jogged"),
            outcome="completed",
            reason="",
            times_s=begin_s + 0.02 * np.arange(20),
            commanded=commanded,
            measured=commanded + 1e-4,
            openings=np.full(20, 0.012),
        )
        return replace(synthetic.transition(synthetic.rope(0.1), synthetic.rope(begin_s / 100)), executed=executed)

    low, carried, high = [0.4, 0.0, 0.03], [0.5, 0.0, 0.03], [0.5, 0.0, site.travel_height_m]
    first, second, third = moved(high, low, 0.0), moved(low, carried, 7.0), moved(carried, high, 30.0)
    elsewhere = moved(high, carried, 50.0)
    one, other = join_motions((first, second, third, elsewhere), site)
    assert other is elsewhere
    assert (one.before is first.before, one.after is third.after) == (True, True)
    assert len(one.executed.commanded) == len(one.executed.tool) == len(one.executed.times_s) == 60
    assert np.diff(one.executed.times_s) == pytest.approx(0.02)
    motion = demonstrated_motion(one.executed, np.append(first.executed.commanded[0], 0.012), site)
    check_motion(motion, motion.digest(), site)
    assert np.allclose(motion.openings, 0.012)


def test_a_pose_and_its_negative_quaternion_are_one(tmp_path: Path) -> None:
    site = small_site(tmp_path)
    start = np.array([0.4, 0.0, 0.1, *TOOL_DOWN, 0.0])
    negative = np.array([0.4, 0.0, 0.1, *(-np.asarray(TOOL_DOWN)), 0.0])
    with pytest.raises(PlanningError, match="at the start pose"):
        way_to(start, negative, None, site)


def test_an_object_that_lies_as_it_was_shown_is_taken_and_one_of_no_numbers_is_not() -> None:
    rope = np.random.default_rng(0).normal(0.0, 0.1, (50, 3)).astype(np.float32)
    require_same_scene(rope, rope + np.float32(1e-3), 0.008)
    for other in (rope + np.float32(0.2), rope * np.float32(np.nan)):
        with pytest.raises(PlanningError, match="lay it as it was shown"):
            require_same_scene(rope, other, 0.008)


def test_the_whole_site_is_asked_before_anything_is_offered(tmp_path: Path) -> None:
    narrow = Site(recordings=tmp_path)
    with pytest.raises(MotionRefused):
        way_to(np.array([0.9, 0.0, 0.2, *TOOL_DOWN, 0.0]), np.array([0.5, 0.0, 0.1, *TOOL_DOWN, 0.0]), None, narrow)
