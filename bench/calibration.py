"""How well calibration recovers a model: episodes of the simulated world, a start wrong by a factor, a grid to compare.

`python -m bench.calibration --help`. The pushes are the policy's and random ones in turn, so that no planning is paid
for; half of the episodes are for fitting and half are held out.
"""

import json
import time
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import tyro
from jaxtyping import Float32

from app.calibration.calibrate import Calibrator, phi_of
from app.calibration.evidence import Evidence, Predictor, gather
from app.calibration.fit import Settings
from app.config import Site
from app.core.messages import Transition
from app.sim.params import PARAMETERS, index
from app.tasks import Task, load, nominal_model
from app.tasks.compiled import advance
from bench.table import Table


def episode(task: Task, seed: int, pushes: int, particle_count: int) -> list[Transition]:
    """Transitions of pushes by the policy and at random in turn."""
    table, rng, seen = Table(task, seed, particle_count), np.random.default_rng(seed), list[Transition]()
    goal, x = task.goal(seed, particle_count), table.observe()
    for number in range(pushes):
        if number % 2:
            action = jnp.asarray(task.actions.sample(rng, x, 1))
        else:
            action = task.policy.act(task.policy.prepare(x, goal), jnp.asarray(x)[None])
        allowed = np.asarray(task.actions.project(action, jnp.asarray(x)[None]))[0]
        seen.append(table.push(task.actions.motion(allowed, Site()), x))
        x = seen[-1].after
    return seen


def grid(task: Task, points: int) -> list[dict[str, float]]:
    """Every combination of the calibrated parameters, `points` of each from 0.3 to 3.3 times the nominal."""
    names = task.calibrated
    nominal = nominal_model(task.name)
    factors = np.meshgrid(*[np.geomspace(0.3, 3.3, points)] * len(names), indexing="ij")
    rows = np.stack([factor.ravel() for factor in factors], axis=1)
    bounds = {name: PARAMETERS[index(name)] for name in names}
    return [
        {
            name: float(np.clip(nominal.value(name) * factor, bounds[name].low, bounds[name].high))
            for name, factor in zip(names, row, strict=True)
        }
        for row in rows
    ]


def with_values(phi: Float32[np.ndarray, " P"], values: dict[str, float]) -> Float32[np.ndarray, " P"]:
    """`phi` with some parameters replaced."""
    changed = phi.copy()
    for name, value in values.items():
        changed[index(name)] = value
    return changed


def main(
    task: str = "rope_push",
    preset: str = "cpu",
    episodes: int = 10,
    pushes: int = 8,
    factor: float = 3.0,
    grid_points: int = 7,
    out: Path | None = None,
) -> None:
    """Fit from both wrong corners, compare with the grid on what was held out."""
    data = load(task)
    count = data.preset(preset).particle_count
    drawn = [episode(data, seed, pushes, count) for seed in range(episodes)]
    known, held_out = (
        gather([t for seen in part for t in seen], data.actions.measured_path)
        for part in (drawn[: episodes // 2], drawn[episodes // 2 :])
    )
    predictor, phi = Predictor(advance=advance(task, count), chunk=8), phi_of(nominal_model(task))
    scores = [(_mean(predictor, with_values(phi, values), held_out), values) for values in grid(data, grid_points)]
    best_m2, best = min(scores, key=lambda score: score[0])
    still_m2 = _motionless(held_out)
    print(f"held out, {len(held_out)} transitions: no motion {still_m2:.3e} m^2, best on the grid {best_m2:.3e} {best}")
    rows = [_fitted(data, predictor, phi, known, held_out, start, best_m2=best_m2) for start in (factor, 1 / factor)]
    if out is not None:
        out.write_text(json.dumps({"no_motion_m2": still_m2, "grid_m2": best_m2, "grid": best, "fits": rows}))


def _fitted(
    data: Task,
    predictor: Predictor,
    phi: Float32[np.ndarray, " P"],
    known: Evidence,
    held_out: Evidence,
    factor: float,
    *,
    best_m2: float,
) -> dict[str, float | list[float]]:
    """Fit from every calibrated parameter wrong by `factor`."""
    wrong = {name: float(phi[index(name)]) * factor for name in data.calibrated}
    wrong = {
        name: float(np.clip(v, PARAMETERS[index(name)].low, PARAMETERS[index(name)].high)) for name, v in wrong.items()
    }
    calibrator = Calibrator(predictor=predictor, names=data.calibrated, settings=Settings(steps=10))
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    found = calibrator.fit(known, with_values(phi, wrong))
    wall_s, cpu_s = time.perf_counter() - wall_s, time.process_time() - cpu_s
    values = dict(zip(data.calibrated, map(float, found.values), strict=True))
    low, high = (dict(zip(data.calibrated, map(float, end), strict=True)) for end in (found.low, found.high))
    row: dict[str, float | list[float]] = {
        "factor": factor,
        "trials_m2": list(found.trials_m2),
        "wall_s": wall_s,
        "cpu_s": cpu_s,
        "fitted_m2": found.loss_m2,
    }
    row |= values | {f"{name} low": low[name] for name in low} | {f"{name} high": high[name] for name in high}
    held_out_m2 = _mean(predictor, with_values(phi, values), held_out)
    row |= {"held_out_m2": held_out_m2, "over_grid": held_out_m2 / best_m2}
    print(json.dumps(row), flush=True)
    return row


def _mean(predictor: Predictor, phi: Float32[np.ndarray, " P"], evidence: Evidence) -> float:
    """Mean one-step Chamfer distance [m^2]; infinite where the simulation fails."""
    losses = predictor.losses(phi, evidence)
    return float(losses.mean()) if np.isfinite(losses).all() else float("inf")


def _motionless(evidence: Evidence) -> float:
    """The same of a model in which nothing moves."""
    frozen = Predictor(advance=lambda _phi, x, _tool: x, chunk=8)
    return _mean(frozen, phi_of(nominal_model("rope_push")), evidence)


if __name__ == "__main__":
    tyro.cli(main)
