"""A motion that discovery asks for waits until it can begin, is offered, and is dropped by a decision about itself."""

from pathlib import Path

import pytest

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.summary import Summary
from app.core.messages import Goal, Notice, Particles, fresh_id
from app.jobs.worker_api import nominal_model
from app.session.perception_stage import Sensing
from app.session.suggested_motions import Asking, Probing
from app.tasks import load
from app.tasks.elements.base import EpisodeConfig
from tests.session.cell import MemoryLog, small_site
from tests.session.rig import SmallRig
from tests.session.test_model_monitor import Shown
from tests.session.virtual import InsideWorker, VirtualClock
from tests.tasks.test_suggested_held import carry, gripper, hanging

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]

TASK = load("cloth_hang")
COUNT = TASK.preset("cpu").particle_count


def seen() -> Particles:
    """A cloth that hangs from a gripper."""
    x = hanging(COUNT)
    return Particles(id=fresh_id("particles"), time_s=1.0, positions=x, surface=x, reconstruction_s=0.1)


async def test_a_carry_waits_for_a_grasp_and_other_decisions_do_not_drop_it(tmp_path: Path) -> None:
    config = EpisodeConfig(
        task=TASK,
        preset="cpu",
        goal=Goal(id=fresh_id("goal"), time_s=0.0, positions=TASK.goal(0, COUNT)),
        model=None,
        seed=1,
        pushes=2,
        automatic=False,
        calibrating=False,
        asked=(carry(1),),
    )
    shown, clock = Shown(0), VirtualClock()
    async with InsideWorker("planner") as planner:
        announcer = MessageBus(operator=shown, recorder=MemoryLog(), clock=clock, summary=Summary())
        sensing = Sensing(SmallRig(small_site(tmp_path)), TASK.reconstruction("cpu"), Summary(), announcer, clock)
        probing = Probing(config, planner, Site(), sensing, announcer, clock)
        asking = Asking(config, announcer, planner, Site(), probing)
        goal, model, x = config.goal.positions, nominal_model(TASK.name), seen()
        for _ in range(2):
            assert await asking.plan(x, goal, model, tool=gripper((0, 0, 0), 0.0, 0.08)) is None
            asking.drop_offered()
        plan = await asking.plan(x, goal, model, tool=gripper((0, 0, 0), 0.0, 0.004))
        assert plan is not None
        assert plan.branches[plan.best].origin == "asked"
        asking.drop_offered()
        assert await asking.plan(x, goal, model, tool=gripper((0, 0, 0), 0.0, 0.004)) is None
    said = [message.text for message in shown.seen if isinstance(message, Notice)]
    assert said == [
        "The motion that discovery asks for is offered once the gripper holds the cloth.",
        "Offered: the motion that discovery asks for, as it asks for it.",
    ]
