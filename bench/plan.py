"""Performance of the planner on pushes: episodes in the simulated world, without cameras. See `--help`."""

import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from app.core.errors import PlanningError
from app.core.geometry.chamfer import chamfer_m2
from app.core.messages import Transition
from app.jobs.worker_api import nominal_model, plan, update
from app.tasks import Task, load
from bench.table import Table


@dataclass(frozen=True, kw_only=True)
class Push:
    """One decision and its outcome; Chamfer distances to the goal [m^2], `error_m2` to the prediction."""

    before_m2: float
    predicted_m2: float
    after_m2: float
    error_m2: float
    moved_m2: float
    cost_before: float
    cost_after: float
    origin: str
    dropped: int
    plan_s: float
    plan_cpu_s: float


def episode(task: Task, preset: str, seed: int, pushes: int, *, calibrating: bool = False) -> list[Push]:
    """Push until the goal is reached or `pushes` are used up."""
    table = Table(task, seed, task.preset(preset).particle_count)
    goal = task.goal(seed, task.preset(preset).particle_count)
    model, seen = nominal_model(task.name), list[Transition]()
    x, done = table.observe(), list[Push]()
    while len(done) < pushes and not task.success.is_reached(x, goal):
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        found = plan(task.name, preset, x, goal, model, 1000 * seed + len(done))
        wall_s, cpu_s = time.perf_counter() - wall_s, time.process_time() - cpu_s
        transition = table.push(found.motion, x)
        best = found.branches[found.best]
        done.append(
            Push(
                before_m2=found.chamfer_m2,
                predicted_m2=found.predicted_chamfer_m2,
                after_m2=float(chamfer_m2(transition.after, goal)),
                error_m2=float(chamfer_m2(transition.after, found.predicted)),
                moved_m2=float(chamfer_m2(transition.after, x)),
                cost_before=best.cost_before,
                cost_after=best.cost_after,
                origin=best.origin,
                dropped=sum(not branch.finite for branch in found.branches),
                plan_s=wall_s,
                plan_cpu_s=cpu_s,
            )
        )
        x = transition.after
        seen.append(transition)
        model = update(task.name, preset, seen, model) if calibrating else model
    return done


def summary(episodes: list[list[Push]]) -> dict[str, float]:
    """The issue's measures over all episodes."""
    pushes = [push for episode in episodes for push in episode]
    ratios = np.array([episode[-1].after_m2 / episode[0].before_m2 for episode in episodes])
    return {
        "episodes": len(episodes),
        "median_final_over_initial": float(np.median(ratios)),
        "improved": int((ratios < 1).sum()),
        "worst_final_over_initial": float(ratios.max()),
        "decisions": len(pushes),
        "decisions_descended": sum(push.cost_after < push.cost_before for push in pushes),
        "one_step_error_over_motion": float(
            np.mean([push.error_m2 for push in pushes]) / np.mean([push.moved_m2 for push in pushes])
        ),
        "plan_s_median": float(np.median([push.plan_s for push in pushes])),
        "plan_cpu_s_median": float(np.median([push.plan_cpu_s for push in pushes])),
        "dropped_branches": sum(push.dropped for push in pushes),
    }


def _line(seed: int, index: int, push: Push) -> str:
    before, predicted, after, error, moved = (
        1e3 * np.sqrt(value / 2)
        for value in (push.before_m2, push.predicted_m2, push.after_m2, push.error_m2, push.moved_m2)
    )
    return (
        f"seed {seed} push {index}: {before:5.1f} -> {after:5.1f} mm (predicted {predicted:5.1f}; moved {moved:4.1f}, "
        f"prediction off by {error:4.1f}); cost {push.cost_before:+.5f} -> {push.cost_after:+.5f} ({push.origin}); "
        f"{push.plan_s:.1f} s, {push.plan_cpu_s:.1f} s CPU"
    )


def main(
    task: str = "rope_push",
    preset: str = "cpu",
    seeds: Annotated[tuple[int, ...], tyro.conf.arg(help="Episodes to run.")] = tuple(range(10)),
    pushes: int = 10,
    calibrating: bool = False,
    out: Path | None = None,
) -> None:
    """Run the episodes, print a line a push, and write everything as JSON to `out`."""
    data, episodes = load(task), list[list[Push]]()
    for seed in seeds:
        try:
            done = episode(data, preset, seed, pushes, calibrating=calibrating)
        except PlanningError as error:
            print(f"seed {seed}: {error}")
            raise SystemExit(error.exit_code) from error
        episodes.append(done)
        print("\n".join(_line(seed, index, push) for index, push in enumerate(done, start=1)))
        print(f"seed {seed}: final / initial {done[-1].after_m2 / done[0].before_m2:.3f}", flush=True)
    print(json.dumps(summary(episodes), indent=1))
    if out is not None:
        out.write_text(json.dumps({"summary": summary(episodes), "pushes": [[asdict(p) for p in e] for e in episodes]}))


if __name__ == "__main__":
    tyro.cli(main)
