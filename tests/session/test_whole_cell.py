"""A whole cell in this process, in virtual time: MuJoCo's rope, rendered images, perception and the paper's planner."""

from pathlib import Path

import pytest

from app.config import Site
from app.core.messages import Executed, Goal, Outcome, fresh_id
from app.session import Parts, Session
from app.tasks import load
from app.tasks.elements.base import EpisodeConfig
from tests.rig.lockstep_rig import lockstep_rig
from tests.session.cell import MemoryLog, Person
from tests.session.virtual import InsideWorker, VirtualClock

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time"), pytest.mark.slow]

SEED = 1


async def test_an_automatic_session_brings_the_rope_nearer_to_its_goal(tmp_path: Path) -> None:
    task, site, clock = load("rope_push"), Site(recordings=tmp_path), VirtualClock()
    count = task.preset("cpu").particle_count
    config = EpisodeConfig(
        task=task,
        preset="cpu",
        goal=Goal(id=fresh_id("goal"), time_s=clock.now(), positions=task.goal(SEED, count)),
        model=None,
        seed=SEED,
        pushes=2,
        automatic=True,
        calibrating=False,
    )
    async with lockstep_rig(stage=task.stage, start=task.start(SEED), site=site, seed=SEED, clock=clock) as rig:
        person, log = Person(rig.arm.stop), MemoryLog()
        ports = {"site": site, "rig": rig, "operator": person, "recorder": log, "clock": clock}
        parts = Parts(config, **ports, planner=InsideWorker("planner"), computers=InsideWorker)
        summary = await Session(parts).run()
    assert [made.outcome for made in person.all(Executed)] == ["completed"] * 2
    assert len(person.all(Outcome)) == summary.pushes == 2
    assert summary.faults == []
    assert summary.chamfer_m2[-1] < 0.5 * summary.chamfer_m2[0]
