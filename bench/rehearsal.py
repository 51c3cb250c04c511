"""Random pushes of a simulated rope without cameras, for benches and tests that see it by themselves."""

from collections.abc import Iterator, Sequence

from app.policy.random_pushes import PushDesign
from app.rig.simulated.injected_effects.base import InjectedEffect
from app.rig.simulated.push_session import PushSample, PushSession
from app.rig.simulated.worlds.physics import WorldPhysics
from app.tasks.elements.base import Task


def rehearse(
    task: Task, plan: PushDesign, physics: WorldPhysics, hidden: Sequence[InjectedEffect], seed: int
) -> Iterator[PushSample]:
    """All pushes of all episodes in order; each episode lays the rope anew, its ends nearest to where they were."""
    session = PushSession(task, plan, physics, hidden, seed)
    for _ in range(plan.episodes * plan.pushes):
        session.look()
        yield session.push(session.random())
