"""Accuracy of the model's prediction of sweeps of beans: episodes of `bean_sweep` in lock step. See `--help`."""

import json
from dataclasses import asdict, dataclass
from typing import final

import numpy as np
import tyro

from app.core.geometry.chamfer import chamfer_m2
from app.core.types import Points
from app.evaluation.episode import EpisodeStep, EvaluationConfig, Eyes, play
from app.jobs.worker_api import nominal_model
from app.planner.method import Method
from app.tasks import load
from app.tasks.elements.success import SuccessCriterion


@final
@dataclass(frozen=True, kw_only=True)
class Sweep:
    """One decision and its outcome, as observed; Chamfer distances [m^2].

    Shares are those of the beans on the mat. `error_m2`: from what was predicted to what came; `moved_m2`: from what
    was before, which is the error of the prediction that nothing moves.
    """

    seed: int
    origin: str
    before: float
    predicted: float
    after: float
    chamfer_m2: float
    predicted_chamfer_m2: float
    error_m2: float
    moved_m2: float


def sweep(seed: int, step: EpisodeStep, aim: SuccessCriterion, goal: Points) -> Sweep:
    """Quantities of a step that tell how good the model is."""
    before, plan, after = step.before.positions, step.plan, step.after.positions
    return Sweep(
        seed=seed,
        origin=plan.branches[plan.best].origin,
        before=aim.share(before, goal),
        predicted=aim.share(plan.predicted, goal),
        after=aim.share(after, goal),
        chamfer_m2=float(chamfer_m2(after, goal)),
        predicted_chamfer_m2=plan.predicted_chamfer_m2,
        error_m2=float(chamfer_m2(plan.predicted, after)),
        moved_m2=float(chamfer_m2(before, after)),
    )


def main(
    seeds: tuple[int, ...] = (0, 1, 2),
    preset: str = "cpu",
    ablation: str | None = None,
    eyes: Eyes = "cameras",
) -> None:
    """Print one JSON object a sweep, planned with the nominal model, and their medians."""
    task, made = load("bean_sweep"), list[Sweep]()
    for seed in seeds:
        goal, model = task.goal(seed, task.preset(preset).particle_count), nominal_model(task.name)
        method = Method.of(ablation=ablation)
        order = EvaluationConfig(task=task, preset=preset, seed=seed, method=method, model=model, eyes=eyes)

        def tell(step: EpisodeStep, seed: int = seed, goal: Points = goal) -> None:
            made.append(sweep(seed, step, task.success, goal))
            print(json.dumps(asdict(made[-1])), flush=True)

        played = play(order, tell)
        print(f"seed {seed}: {played.share[-1]:.2f} on the mat after {len(played.decision_s)} sweeps. {played.failure}")
    error_m2, moved_m2, share_off = np.median(
        [(each.error_m2, each.moved_m2, abs(each.predicted - each.after)) for each in made], axis=0
    )
    print(
        f"Median of {len(made)} sweeps: predicted to {1e6 * error_m2:.0f} mm^2 where {1e6 * moved_m2:.0f} mm^2 moved; "
        f"the share on the mat to {share_off:.3f}."
    )


if __name__ == "__main__":
    tyro.cli(main)
