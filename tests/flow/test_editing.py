"""The motion that an operator changed: noted of the plan that is up alone, simulated once, or refused in words."""

import anyio
import numpy as np
import pytest

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.requests import EditRequest
from app.core.dialogue.summary import Summary
from app.core.messages import Goal, Notice, fresh_id
from app.flow.editing import Editing
from app.jobs.worker_api import nominal_model
from app.tasks import load
from app.tasks.elements.base import EpisodeConfig
from tests.flow.cell import MemoryLog
from tests.flow.test_model_monitor import Shown
from tests.flow.virtual import InsideWorker, VirtualClock
from tests.ui import synthetic

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]

TASK = load("rope_push")
COUNT = TASK.preset("cpu").particle_count
OBSERVED = TASK.particles(TASK.start(1), COUNT)
GOAL = TASK.goal(1, COUNT)
PROPOSAL = synthetic.proposal(OBSERVED, branches=3)


def request(start: tuple[float, float], end: tuple[float, float], *, of: str = PROPOSAL.id) -> EditRequest:
    return EditRequest(
        id=fresh_id("edit"),
        time_s=anyio.current_time(),
        operator="client 0",
        proposal_id=fresh_id("proposal") if of != PROPOSAL.id else PROPOSAL.id,
        start=np.array([*start, 0.006]),
        end=np.array([*end, 0.006]),
        branch=2,
    )


def editing(shown: Shown, planner: InsideWorker) -> Editing:
    wish = EpisodeConfig(
        task=TASK,
        preset="cpu",
        goal=Goal(id=fresh_id("goal"), time_s=0.0, positions=GOAL),
        model=None,
        seed=1,
        pushes=1,
        automatic=False,
        calibrating=False,
    )
    announcer = MessageBus(operator=shown, recorder=MemoryLog(), clock=VirtualClock(), summary=Summary())
    return Editing(wish, announcer, planner, Site())


async def test_a_change_of_the_plan_that_is_up_is_simulated_once() -> None:
    shown = Shown(0)
    async with InsideWorker("planner") as planner:
        stage, particles, model = editing(shown, planner), synthetic.particles(OBSERVED), nominal_model("rope_push")
        with anyio.fail_after(300):
            assert await stage.plan(particles, GOAL, model) is None
            assert stage.wanted(request((0.30, -0.30), (0.36, -0.30)), PROPOSAL)
            stage.answered()
            assert await stage.plan(particles, GOAL, model) is None
            assert stage.wanted(request((0.30, -0.30), (0.36, -0.30)), PROPOSAL)
            found = await stage.plan(particles, GOAL, model)
            assert await stage.plan(particles, GOAL, model) is None
    assert found is not None
    assert [branch.origin for branch in found.branches] == ["edited", "policy", "random", "random"]
    np.testing.assert_allclose(found.motion.positions[1, :2], (0.30, -0.30), atol=1e-5)
    assert shown.seen == []


async def test_what_cannot_be_made_is_refused_in_words_and_forgotten() -> None:
    shown = Shown(0)
    async with InsideWorker("planner") as planner:
        stage, particles, model = editing(shown, planner), synthetic.particles(OBSERVED), nominal_model("rope_push")
        assert stage.wanted(request((0.30, -0.30), (0.80, -0.30)), PROPOSAL)
        with anyio.fail_after(300):
            assert await stage.plan(particles, GOAL, model) is None
            assert await stage.plan(particles, GOAL, model) is None
    (notice,) = shown.seen
    assert isinstance(notice, Notice)
    assert "bring its ends closer together" in notice.text


async def test_a_change_of_another_plan_is_not_wanted() -> None:
    shown = Shown(0)
    stage = editing(shown, InsideWorker("planner"))
    assert not stage.wanted(request((0.3, -0.3), (0.4, -0.3), of="another"), PROPOSAL)
    assert not stage.wanted(request((0.3, -0.3), (0.4, -0.3)), None)
    assert all(isinstance(said, Notice) and "not the plan shown" in said.text for said in shown.seen)
    assert len(shown.seen) == 2
