"""Times of a decision by each planning method on this machine, as multiples of the whole tree's. See `--help`.

Methods are given simulations worth as much as the tree's (`app.planner.search.budget`). Whether that is as much time,
too, is measured here.
"""

from collections.abc import Callable, Sequence
from typing import Annotated, Literal

import numpy as np
import tyro

from app.commands._named import full_name
from app.config import Site
from app.jobs import jit_cache
from app.jobs.worker_api import choose_preset
from app.planner.base import Planner
from app.planner.method import ABLATIONS, PAPER, Method
from app.planner.planner_factory import make_planner
from app.planner.search.request import PlanRequest
from app.rig.simulated.lockstep import LockStep
from app.tasks import load, names
from bench.decisions import timed

METHODS = (PAPER, "no_policy", "no_optimisation", "cem_mpc", "diff_cem_mpc", "mppi")


def method_of(name: str) -> Method:
    """The planner, or the ablation of the paper's, of this name."""
    return Method.of(ablation=name) if name in ABLATIONS else Method(planner=name)


def times(task: str, methods: Sequence[str], preset: str, repeats: int) -> list[float]:
    """Median seconds of each method's decision at the start of problem 0, after one that compiles."""
    data = load(task)
    phi, size = jit_cache.phi_of(jit_cache.nominal_model(task)), data.preset(preset)
    cell = LockStep(data.stage, data.start(0), Site(), 0)
    x, goal = data.particles(cell.nodes(), size.particle_count), data.goal(0, size.particle_count)
    search = jit_cache.search(task, preset, phi)

    def decide(planner: Planner) -> Callable[[int], object]:
        return lambda seed: planner(PlanRequest(observed=x, goal=goal, phi=phi, seed=seed, tool=cell.tool)).best

    planners = [make_planner(method_of(name), search, data.descent, size.gradient_steps) for name in methods]
    return [timed(decide(planner), repeats) for planner in planners]


def main(
    task: Annotated[tuple[str, ...], tyro.conf.arg(help="Full names; the hard problems of all where none is.")] = (),
    methods: Annotated[tuple[str, ...], tyro.conf.arg(help="Planners, and ablations of dipac.")] = METHODS,
    preset: Literal["auto", "cpu", "gpu"] = "auto",
    repeats: int = 3,
) -> None:
    """Print a table: seconds of the first method's decision, and the others' as multiples of it."""
    size, rows = preset if preset != "auto" else choose_preset(), list[list[str]]()
    for name in task or [full_name(each, dynamics=None, problems="hard") for each in names()]:
        taken = np.array(times(name, methods, size, repeats))
        rows.append([name, f"{taken[0]:.2f} s", *(f"{ratio:.2f}" for ratio in taken[1:] / taken[0])])
        print(" ".join(rows[-1]), flush=True)
    print("\n".join("| " + " | ".join(row) + " |" for row in [["task", *methods], ["---"] * (1 + len(methods)), *rows]))


if __name__ == "__main__":
    tyro.cli(main)
