"""Loss and gain of descent from fewer branches, by more steps, in decisions of the tree. See `--help`."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

import jax
import jax.numpy as jnp
import numpy as np
import tyro
from jaxtyping import Array, Float

from app.config import Site
from app.jobs import jit_cache
from app.planner.search.optimise import OptimizedRollouts, OptimizerConfig, descend
from app.planner.search.request import PlanRequest
from app.planner.search.rollout_frames import grow
from app.planner.search.tree import RootBatch, TreeConfig, simulate, start
from app.rig.simulated.lockstep import LockStep
from app.tasks import load

_SAME_MM2 = 1.0
"""Difference of costs that counts as none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Descents:
    """Costs of B branches after each step of a descent from all of them, the cheapest so far: (G, B).

    Of finite actions, whether they are allowed or not; the planner ranks those that are not behind all others.
    """

    seed: int
    action: int
    cost: Float[np.ndarray, "G B"]

    def best(self, branches: int, steps: int) -> float:
        """The cost of a decision that descends so many steps from so many branches, those that cost least at first."""
        cheapest = np.argsort(self.cost[0], kind="stable")[:branches]
        return float(min(self.cost[steps, cheapest].min(), self.cost[0].min()))


def descents(task: str, preset: str, seeds: list[int], actions: int, steps: int) -> list[Descents]:
    """Decisions along episodes of as many actions in a world that does as the model predicts."""
    data = load(task)
    size, phi = data.preset(preset), jit_cache.phi_of(jit_cache.nominal_model(task))
    search, found = jit_cache.search(task, preset, phi), list[Descents]()
    for seed in seeds:
        goal = data.goal(seed, size.particle_count)
        cell = LockStep(data.stage, data.start(seed), Site(), seed)
        x, tool = data.particles(cell.nodes(), size.particle_count), cell.tool
        for action in range(actions):
            request = PlanRequest(observed=x, goal=goal, phi=phi, seed=1000 * seed + action, tool=tool)
            rolled, ended = jax.device_get(
                _descend(search, data.descent, steps, start(search, request), jnp.asarray(goal))
            )
            cost = np.where(np.isfinite(rolled.iterates), rolled.iterates, np.inf)
            found.append(Descents(seed=seed, action=action, cost=np.minimum.accumulate(cost, axis=0)))
            print(_line(found[-1]), flush=True)
            best = int(np.argmin(np.where(rolled.finite & rolled.best.allowed, rolled.best.cost, np.inf)))
            x, tool = rolled.best.first[best], ended[best]
    return found


@partial(jax.jit, static_argnums=(0, 1, 2))
def _descend(
    search: TreeConfig, descent: OptimizerConfig, steps: int, tree: RootBatch, goal: Float[Array, "M 3"]
) -> tuple[OptimizedRollouts, Float[Array, "B 8"]]:
    evaluate = partial(simulate, search, tree.phi, tree.now, goal)
    actions = grow(search, tree, goal).rollout.actions
    found = descend(evaluate, actions, steps=steps, descent=descent, scale=search.space.scale())
    return found, search.space.after(found.best.actions[:, 0], tree.now.tool)


def _line(found: Descents) -> str:
    costs = ", ".join(f"{1e6 * found.best(found.cost.shape[1], steps):.0f}" for steps in range(len(found.cost)))
    return f"seed {found.seed} action {found.action}: {costs} mm^2"


def table(found: list[Descents], gradient_steps: int) -> str:
    """Mean cost more than that of descent from all branches by half the steps, and in how many decisions it is so.

    That is as much work as `gradient_steps` from half of them, which is what a tree does that says nothing else.
    """
    branches, most, half = found[0].cost.shape[1], len(found[0].cost) - 1, -(-gradient_steps // 2)
    whole = np.array([each.best(branches, half) for each in found])
    lines = ["| branches | steps | work | cost more [mm^2] | standard error | worse | better |", "|" + "---|" * 7]
    for count in sorted({branches, -(-branches // 2), -(-branches // 4), -(-branches // 8)}, reverse=True):
        for steps in sorted({half, gradient_steps, most}):
            more = 1e6 * (np.array([each.best(count, steps) for each in found]) - whole)
            error = more.std(ddof=1) / np.sqrt(len(more)) if len(more) > 1 else np.nan
            work = count * steps / (branches * half)
            lines.append(
                f"| {count} | {steps} | {work:.2f} | {more.mean():.1f} | {error:.1f} "
                f"| {(more > _SAME_MM2).sum()} | {(more < -_SAME_MM2).sum()} |"
            )
    return "\n".join([f"{len(found)} decisions", "", *lines])


def main(
    task: str = "rope_push-hard@rods",
    preset: str = "cpu",
    seeds: Annotated[tuple[int, ...], tyro.conf.arg(help="Episodes.")] = tuple(range(6)),
    actions: int = 3,
    steps: Annotated[int, tyro.conf.arg(help="Gradient steps, more than the task's.")] = 24,
) -> None:
    """Print the cost of each decision by its steps, and a table of what fewer branches and more steps would do."""
    print(table(descents(task, preset, list(seeds), actions, steps), load(task).preset(preset).gradient_steps))


if __name__ == "__main__":
    tyro.cli(main)
