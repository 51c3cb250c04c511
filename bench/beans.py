"""How well beans are swept: episodes of `bean_sweep` in the simulated cell, in lock step. See `--help`.

World, cameras, perception, planner and the arm's path are the application's own; nothing happens while it plans.
"""

import json
import time
from dataclasses import asdict, dataclass
from typing import Annotated, Literal, final

import jax.numpy as jnp
import numpy as np
import tyro

from app.config import Site
from app.core.chamfer import chamfer_m2
from app.core.motion import Motion
from app.core.types import Points, ToolPath
from app.perception.reconstruct import reconstruct
from app.policy.base import AWAY, Now
from app.rig.simulated.eyes import Eyes
from app.rig.simulated.kinds import kind_of
from app.rig.simulated.path import PathFollower, route
from app.tasks import Task, load, nominal_model, plan

_SETTLE_S = 0.6
_SEEDS_A_EPISODE = 1000


@final
class LockStep:
    """One episode's world, cameras and arm; time passes only while the arm moves."""

    def __init__(self, task: Task, seed: int, particle_count: int) -> None:
        self._task, self._count, self._site = task, particle_count, Site()
        self._world = kind_of(task.stage).build(task.stage, task.start(seed), 0.0)
        self._eyes, self._looks = Eyes(task.stage, (), seed), 0
        self._world.step(self._world.tool, _SETTLE_S)

    def look(self) -> Points:
        """What perception makes of the cameras' next images."""
        self._looks += 1
        frames = self._eyes.look(self._world.snapshot(), stamp_s=self._world.time_s, number=self._looks)
        return reconstruct(frames, self._task.reconstruction("cpu")).positions

    def truth(self) -> Points:
        """The same without cameras."""
        return self._task.particles(self._world.nodes(), self._count)

    def execute(self, motion: Motion) -> ToolPath:
        """Make the motion as the arm does, go home, and let all come to rest; the tool's way, period by period."""
        period_s, made = self._site.timing.arm_period_s, [self._world.tool]
        follower = PathFollower(*route(self._world.tool, motion, self._site), self._site.limits.acceleration_m_s2)
        while not follower.at_rest:
            self._world.step(follower.advance(period_s), period_s)
            made.append(self._world.tool)
        self._world.place(AWAY)
        self._world.step(self._world.tool, _SETTLE_S)
        return np.array(made)


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """One decision and what came of it. `share`: of the beans on the mat afterwards, truly; Chamfer distances [m^2]."""

    seed: int
    number: int
    origin: str
    share_before: float
    share: float
    share_seen: float
    predicted_share: float
    chamfer_m2: float
    predicted_chamfer_m2: float
    error_m2: float
    moved_m2: float
    plan_s: float


def episode(seed: int, preset: str, sweeps: int, planner: Literal["tree", "scripted"]) -> list[Sweep]:
    """Sweep until the task is done or `sweeps` are used up."""
    task = load("bean_sweep")
    count, model, site = task.preset(preset).particle_count, nominal_model(task.name), Site()
    cell, goal = LockStep(task, seed, count), task.goal(seed, count)
    x, done = cell.look(), list[Sweep]()
    while len(done) < sweeps and not task.aim.reached(x, goal):
        before, began_s = cell.truth(), time.perf_counter()
        if planner == "tree":
            found = plan(task.name, preset, x, goal, model, _SEEDS_A_EPISODE * seed + len(done))
            motion, predicted, origin = found.motion, found.predicted, found.branches[found.best].origin
        else:
            now = Now.at_rest(jnp.asarray(x)[None])
            action = task.actions.project(task.policy.act(task.policy.prepare(x, goal), now), now)
            motion, predicted, origin = task.actions.motion(np.asarray(action)[0], AWAY, site), x, "policy"
        plan_s = time.perf_counter() - began_s
        cell.execute(motion)
        seen, after = cell.look(), cell.truth()
        done.append(
            Sweep(
                seed=seed,
                number=len(done) + 1,
                origin=origin,
                share_before=task.aim.share(before, goal),
                share=task.aim.share(after, goal),
                share_seen=task.aim.share(seen, goal),
                predicted_share=task.aim.share(predicted, goal),
                chamfer_m2=float(chamfer_m2(seen, goal)),
                predicted_chamfer_m2=float(chamfer_m2(predicted, goal)),
                error_m2=float(chamfer_m2(predicted, seen)),
                moved_m2=float(chamfer_m2(x, seen)),
                plan_s=plan_s,
            )
        )
        x = seen
    return done


def main(
    seeds: Annotated[tuple[int, ...], tyro.conf.arg(help="one episode each")] = (0, 1, 2),
    preset: str = "cpu",
    sweeps: int = 20,
    planner: Literal["tree", "scripted"] = "tree",
) -> None:
    """Print one JSON object a sweep."""
    for seed in seeds:
        for sweep in episode(seed, preset, sweeps, planner):
            print(json.dumps(asdict(sweep)), flush=True)


if __name__ == "__main__":
    tyro.cli(main)
