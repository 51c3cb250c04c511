"""Experiments in a session: pushes chosen, offered like any plan, weighed after each batch, and ended with a reason."""

from pathlib import Path

import anyio
import numpy as np
import pytest

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.summary import Summary
from app.core.geometry.track import Track
from app.core.messages import Episode, Executed, Goal, MessageId, Notice, Particles, Transition, fresh_id
from app.core.motion import Motion
from app.jobs.worker_api import nominal_model
from app.rig.simulated.push_session import push_again
from app.rig.simulated.worlds.physics import WorldPhysics
from app.rig.simulated.worlds.rope import resample
from app.session.perception_stage import Sensing
from app.session.suggested_motions import Asking, Probing
from app.tasks import load
from app.tasks.elements.base import EpisodeConfig, Experiment
from tests.session.cell import MemoryLog, small_site
from tests.session.rig import SmallRig
from tests.session.test_model_monitor import Shown
from tests.session.virtual import InsideWorker, VirtualClock

# Every candidate's slopes and all causes are simulated; what is chosen and why is tested in discovery/test_probe.py.
pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time"), pytest.mark.slow]

TASK = load("rope_push@rods")
COUNT = TASK.preset("cpu").particle_count
OPENING = Episode(
    id=MessageId("episode-0"),
    time_s=0.0,
    task="rope_push",
    rig="small",
    seed=0,
    simulated=True,
    code_version="1",
    config="",
)


def config(experiment: Experiment | None) -> EpisodeConfig:
    return EpisodeConfig(
        task=TASK,
        preset="cpu",
        goal=Goal(id=fresh_id("goal"), time_s=0.0, positions=TASK.goal(0, COUNT)),
        model=None,
        seed=1,
        pushes=2,
        automatic=False,
        calibrating=False,
        experiment=experiment,
        opening=OPENING,
    )


def seen(nodes: np.ndarray, time_s: float) -> Particles:
    x = TASK.particles(nodes, COUNT)
    return Particles(id=fresh_id("particles"), time_s=time_s, positions=x, surface=x, reconstruction_s=0.1)


def track_of(motion: Motion, start_s: float) -> Track:
    """The way of an arm that does as it is told."""
    lengths = np.linalg.norm(np.diff(motion.positions, axis=0), axis=1)
    times = start_s + np.concatenate([[0.0], np.cumsum(lengths / motion.speeds[1:])])
    grid = np.arange(times[0], times[-1], 0.02)
    xyz = np.stack([np.interp(grid, times, column) for column in motion.positions.T], axis=1)
    return Track(times_s=grid, poses=np.concatenate([xyz, np.tile([0.0, 1.0, 0.0, 0.0], (len(grid), 1))], axis=1))


async def test_pushes_are_offered_made_and_weighed_and_the_budget_ends_it(tmp_path: Path) -> None:
    shown, said, clock = Shown(0), MemoryLog(), VirtualClock()
    nodes, now_s = TASK.start(0), 10.0
    async with InsideWorker("planner") as planner:
        announcer = MessageBus(operator=shown, recorder=said, clock=clock, summary=Summary())
        asked = config(Experiment(budget=2, batch=1))
        how = TASK.reconstruction("cpu")
        sensing = Sensing(SmallRig(small_site(tmp_path)), how, Summary(), announcer, clock)
        probing = Probing(asked, planner, Site(), sensing, announcer, clock)
        asking = Asking(asked, announcer, planner, Site(), probing)
        for _ in range(2):
            before = seen(nodes, now_s)
            with anyio.fail_after(600):
                plan = await asking.plan(before, asked.goal.positions, nominal_model(TASK.name))
            assert plan is not None
            assert [branch.origin for branch in plan.branches] == ["asked"]
            track = track_of(plan.motion, now_s + 1.0)
            moved = push_again(TASK, WorldPhysics(), nodes, track)
            assert np.abs(moved - resample(nodes, len(moved))).max() > 0.01
            after = seen(moved, track.end_s + 1.0)
            executed = Executed(
                id=fresh_id("executed"),
                time_s=track.end_s,
                approved_id=fresh_id("approved"),
                outcome="completed",
                reason="",
                times_s=track.times_s,
                commanded=track.poses,
                measured=track.poses,
            )
            asking.drop_offered()
            assert probing.conclusion() == ""
            transition = Transition.between(before, executed, after)
            await probing.put(transition, before, after, lambda _: None)
            nodes, now_s = moved, after.time_s + 1.0
        over = probing.conclusion()
        assert over.startswith(("The 2 pushes that were asked for are made", "Enough"))
        assert probing.conclusion() == ""
        assert await asking.plan(seen(nodes, now_s), asked.goal.positions, nominal_model(TASK.name)) is None
    texts = [message.text for message in shown.seen if isinstance(message, Notice) and message.where == "experiment"]
    assert [text.split(".")[0] for text in texts if text.startswith("Push ")] == [
        "Push 1 of up to 2",
        "Push 2 of up to 2",
    ]
    assert any(text.startswith("After 1 push: ") for text in texts)
    assert any(text.startswith("After 2 pushes: ") for text in texts)
    episodes = [message for message in shown.seen if isinstance(message, Episode)]
    assert [(each.task, each.config) for each in episodes] == [(OPENING.task, OPENING.config)]
    assert episodes[0].id != OPENING.id


async def test_a_session_without_an_experiment_asks_for_nothing(tmp_path: Path) -> None:
    clock = VirtualClock()
    async with InsideWorker("planner") as planner:
        announcer = MessageBus(operator=Shown(0), recorder=MemoryLog(), clock=clock, summary=Summary())
        sensing = Sensing(SmallRig(small_site(tmp_path)), TASK.reconstruction("cpu"), Summary(), announcer, clock)
        probing = Probing(config(None), planner, Site(), sensing, announcer, clock)
        assert await probing.motion(seen(TASK.start(0), 1.0)) is None
        assert probing.conclusion() == ""
