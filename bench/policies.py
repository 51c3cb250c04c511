"""Training and inference times of learned policies: `python -m bench.policies [TASK]`."""

import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Final

import jax
import jax.numpy as jnp
import numpy as np
from rich.console import Console
from rich.table import Table

from app.core.errors import UsageError
from app.jobs.jit_cache import nominal_model
from app.jobs.teaching import lessons, simulator
from app.planner.search.tree import first_action
from app.policy.base import PlanningState
from app.policy.learned import kinds
from app.policy.learned.examples import Examples
from app.policy.learned.train import Progress, TrainingSettings, learn
from app.tasks import load
from app.tasks.elements.base import Task

_STEPS: Final = {"bc": 2000, "act": 1500, "diffusion": 900, "transporter": 600, "ild": 80}
"""Steps of the reduced trainings of docs/results.md, of `_BATCH` situations each."""
_BATCH: Final = 16
_TIMED: Final = 6
_CANDIDATES: Final = 16


def situations(task: Task, count: int = 10) -> Examples:
    """First actions of the scripted policy in so many problems, as examples to time the training."""
    particles, rows = task.preset("cpu").particle_count, []
    for seed in range(count):
        x, goal = task.particles(task.start(seed), particles), task.goal(seed, particles)
        now = PlanningState.at_rest(jnp.asarray(x)[None])
        action = task.policy.act(task.policy.prepare(x, goal), now).mean
        rows.append((x, goal, np.asarray(now.tool[0]), np.asarray(action[0]), x, seed))
    return Examples(*(np.stack(column) for column in zip(*rows, strict=True)))


def milliseconds(act: Callable[[], object], repeats: int = 10) -> float:
    """The median of some, after one that compiles."""
    taken = list[float]()
    for _ in range(repeats + 1):
        began_s = time.perf_counter()
        jax.block_until_ready(act())
        taken.append(1e3 * (time.perf_counter() - began_s))
    return float(np.median(taken[1:]))


def row(task: Task, kind: str, shown: Examples) -> Sequence[str]:
    """Row of times: a step of learning, a training of `_STEPS`, one action, and sixteen."""
    moments = list[float]()

    def listen(_: Progress) -> None:
        moments.append(time.perf_counter())

    world = simulator(task, nominal_model(task.name), shown.x.shape[1])
    settings = TrainingSettings(steps=2 * _TIMED, batch=_BATCH, check_every=_TIMED)
    policy, _ = learn(kinds.load(kind), lessons(task, world), shown, settings, None, listen)
    step_s = (moments[1] - moments[0]) / _TIMED
    prepared = policy.prepare(shown.x[0], shown.goal[0])
    one, many = (PlanningState.at_rest(jnp.tile(jnp.asarray(shown.x[:1]), (count, 1, 1))) for count in (1, _CANDIDATES))
    times = [f"{milliseconds(partial(first_action, policy, prepared, now)):.1f}" for now in (one, many)]
    return [kind, f"{1e3 * step_s:.0f}", str(_STEPS[kind]), f"{_STEPS[kind] * step_s / 60:.1f}", *times]


def main(arguments: Sequence[str]) -> None:
    """Print the table."""
    task = load(arguments[0] if arguments else "rope_push")
    shown = situations(task)
    table = Table(title=f"{task.name}, {shown.x.shape[1]} particles, on {jax.devices()[0].device_kind}")
    for column in ("policy", f"a step of {_BATCH} [ms]", "steps", "training [min]", "1 action [ms]", "16 actions [ms]"):
        table.add_column(column, justify="right")
    for kind in kinds.names():
        try:
            table.add_row(*row(task, kind, shown))
        except UsageError as refused:
            table.add_row(kind, str(refused))
    Console().print(table)


if __name__ == "__main__":
    main(sys.argv[1:])
