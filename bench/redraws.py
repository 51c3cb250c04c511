"""Decisions by trees of other sizes, and by CEM-MPC, from the same states: cost and time. See `--help`."""

import time
from dataclasses import dataclass, replace
from typing import Annotated, Self

import jax.numpy as jnp
import numpy as np
import tyro
from jaxtyping import Float

from app.config import Site
from app.core.types import ToolPose
from app.jobs import jit_cache
from app.planner.base import Planner
from app.planner.method import Method
from app.planner.planner_factory import make_planner
from app.planner.search.plan import Plan
from app.planner.search.request import PlanRequest
from app.rig.simulated.lockstep import LockStep
from app.tasks import load
from app.tasks.elements.base import Task

_SAME_MM2 = 1.0
"""Difference of costs that counts as none."""


@dataclass(frozen=True, kw_only=True)
class Size:
    """Size of a tree: its branches, of how many it descends by how many steps, and spreads of its redraws [scale]."""

    branches: int
    descended: int
    steps: int
    redraws: tuple[float, ...]

    @classmethod
    def parse(cls, text: str) -> Self:
        """The size that says "BRANCHES/DESCENDED/STEPS", or with "/SPREAD+SPREAD" behind it."""
        branches, descended, steps, *spreads = text.split("/")
        redraws = tuple(float(spread) for each in spreads for spread in each.split("+"))
        return cls(branches=int(branches), descended=int(descended), steps=int(steps), redraws=redraws)


def planners(task: str, sizes: list[str]) -> dict[str, Planner]:
    """Trees of these sizes, and CEM-MPC with the budget of the first."""
    data, phi = load(task), jit_cache.phi_of(jit_cache.nominal_model(task))
    search = jit_cache.search(task, "cpu", phi)

    def planner(text: str, name: str = "dipac") -> Planner:
        size = Size.parse(text)
        sized = replace(search, branches=size.branches, descended=size.descended, redraws=size.redraws)
        return make_planner(Method(planner=name), sized, data.descent, size.steps)

    return {**{text: planner(text) for text in sizes}, "cem_mpc": planner(sizes[0], "cem_mpc")}


def decide(task: str, sizes: list[str], seeds: list[int], actions: int) -> Float[np.ndarray, "M K 2"]:
    """Cost [mm^2] and seconds of each of M planners in each of K decisions.

    Along episodes in a world that does as the model predicts, in which the cheapest of all is made.
    """
    data = load(task)
    phi, count = jit_cache.phi_of(jit_cache.nominal_model(task)), data.preset("cpu").particle_count
    methods, rows = planners(task, sizes), list[list[tuple[float, float]]]()
    for seed in seeds:
        goal, cell = data.goal(seed, count), LockStep(data.stage, data.start(seed), Site(), seed)
        x, tool = data.particles(cell.nodes(), count), cell.tool
        for action in range(actions):
            plans, row = list[Plan](), list[tuple[float, float]]()
            for planner in methods.values():
                began_s = time.perf_counter()
                plans.append(planner(PlanRequest(observed=x, goal=goal, phi=phi, seed=1000 * seed + action, tool=tool)))
                row.append((1e6 * _cost(plans[-1]), time.perf_counter() - began_s))
            rows.append(row)
            print(f"seed {seed} action {action}: " + ", ".join(f"{cost:.0f}" for cost, _ in row), flush=True)
            best = min(plans, key=_cost)
            x, tool = best.predicted, _pose_after(data, best, tool)
    return np.array(rows).swapaxes(0, 1)


def _pose_after(task: Task, plan: Plan, tool: ToolPose) -> ToolPose:
    first = jnp.asarray(plan.branches[plan.best].actions[:1])
    return np.array(task.actions.after(first, jnp.asarray(tool)[None])[0])


def _cost(plan: Plan) -> float:
    return plan.branches[plan.best].cost_after


def table(names: list[str], found: Float[np.ndarray, "M K 2"]) -> str:
    """Means of each planner, and how much less it costs than the first one."""
    lines = ["| tree | cost [mm^2] | less [mm^2] | standard error | less in | more in | s |", "|" + "---|" * 7]
    for name, (cost, seconds) in zip(names, found.transpose(0, 2, 1), strict=True):
        less = found[0, :, 0] - cost
        error = less.std(ddof=1) / np.sqrt(len(less)) if len(less) > 1 else np.nan
        lines.append(
            f"| {name} | {cost.mean():.0f} | {less.mean():.0f} | {error:.0f} | {(less > _SAME_MM2).sum()} "
            f"| {(less < -_SAME_MM2).sum()} | {np.median(seconds):.2f} |"
        )
    return "\n".join([f"{found.shape[1]} decisions", "", *lines])


def main(
    task: str = "bean_sweep-hard",
    sizes: Annotated[
        tuple[str, ...], tyro.conf.arg(help="BRANCHES/DESCENDED/STEPS, and /SPREAD+SPREAD of redraws.")
    ] = ("16/8/5", "96/2/8", "48/2/6/8+3", "32/2/6/8+3"),
    seeds: Annotated[tuple[int, ...], tyro.conf.arg(help="Episodes.")] = (4, 5, 6, 7),
    actions: int = 6,
) -> None:
    """Print what decisions cost, and a table of it. The world does as the model predicts."""
    print(table([*sizes, "cem_mpc"], decide(task, list(sizes), list(seeds), actions)))


if __name__ == "__main__":
    tyro.cli(main)
