"""The motion that an operator changed: simulated, or refused in words."""

from pathlib import Path

import anyio
import numpy as np
import pytest

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.requests import EditRequest
from app.core.dialogue.summary import Summary
from app.core.messages import Goal, Notice, Proposal, fresh_id
from app.jobs.worker_api import nominal_model
from app.session.perception_stage import Sensing
from app.session.planning import Planning
from app.session.suggested_motions import Probing
from app.tasks import load
from app.tasks.elements.base import EpisodeConfig
from tests.session.cell import MemoryLog, small_site
from tests.session.rig import SmallRig
from tests.session.test_model_monitor import Shown
from tests.session.virtual import InsideWorker, VirtualClock
from tests.ui import synthetic

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]

TASK = load("rope_push")
COUNT = TASK.preset("cpu").particle_count
OBSERVED = TASK.particles(TASK.start(1), COUNT)
GOAL = TASK.goal(1, COUNT)
PROPOSAL = synthetic.proposal(OBSERVED, branches=3)


def request(start: tuple[float, float], end: tuple[float, float]) -> EditRequest:
    return EditRequest(
        id=fresh_id("edit"),
        time_s=anyio.current_time(),
        operator="client 0",
        proposal_id=PROPOSAL.id,
        start=np.array([*start, 0.006]),
        end=np.array([*end, 0.006]),
        branch=2,
    )


WISH = EpisodeConfig(
    task=TASK,
    preset="cpu",
    goal=Goal(id=fresh_id("goal"), time_s=0.0, positions=GOAL),
    model=None,
    seed=1,
    pushes=1,
    automatic=False,
    calibrating=False,
)


async def changed(asked: EditRequest, shown: Shown, tmp_path: Path) -> Proposal | None:
    """The plan that is shown, changed as asked."""
    clock, summary, site = VirtualClock(), Summary(), Site()
    announcer = MessageBus(operator=shown, recorder=MemoryLog(), clock=clock, summary=summary)
    sensing = Sensing(SmallRig(small_site(tmp_path)), TASK.reconstruction("cpu"), summary, announcer, clock)
    async with InsideWorker("planner") as planner:
        probing = Probing(WISH, planner, site, sensing, announcer, clock)
        planning = Planning(WISH, planner, site, probing, announcer, clock)
        with anyio.fail_after(300):
            observed = synthetic.particles(OBSERVED)
            return await planning.edit(WISH, asked, PROPOSAL, observed, nominal_model("rope_push"))


async def test_a_change_of_the_plan_that_is_shown_is_simulated(tmp_path: Path) -> None:
    shown = Shown(0)
    found = await changed(request((0.30, -0.30), (0.36, -0.30)), shown, tmp_path)
    assert found is not None
    assert [branch.origin for branch in found.branches] == ["edited", "policy", "random", "random"]
    np.testing.assert_allclose(found.motion.positions[1, :2], (0.30, -0.30), atol=1e-5)
    assert shown.seen == []


async def test_what_cannot_be_made_is_refused_in_words(tmp_path: Path) -> None:
    shown = Shown(0)
    assert await changed(request((0.30, -0.30), (0.80, -0.30)), shown, tmp_path) is None
    (notice,) = shown.seen
    assert isinstance(notice, Notice)
    assert "bring its ends closer together" in notice.text
