"""Recovery of a model by calibration: episodes of the simulated world, a wrong initial guess, a grid to compare.

`python -m bench.calibration --help`. The pushes are the policy's and random ones in turn, which costs no planning.
Fits to half of the episodes are scored on the others: a few pushes that no parameters predict make half of the loss,
so that a single division says little.
"""

import json
import time
from pathlib import Path
from typing import cast

import jax.numpy as jnp
import numpy as np
import tyro
from jaxtyping import Float32

from app.calibration.calibrate import Calibrator, phi_of
from app.calibration.evidence import Evidence, ModelScorer, gather
from app.calibration.fit import FitSettings
from app.config import Site
from app.core.messages import Transition
from app.jobs.jit_cache import advance
from app.jobs.worker_api import nominal_model
from app.policy.base import PARKED_POSE, PlanningState
from app.sim.model.params import index
from app.tasks import Task, load
from bench.table import Table


def episode(task: Task, seed: int, pushes: int, particle_count: int) -> list[Transition]:
    """Transitions of pushes by the policy and at random in turn."""
    table, rng, seen = Table(task, seed, particle_count), np.random.default_rng(seed), list[Transition]()
    goal, x = task.goal(seed, particle_count), table.observe()
    for number in range(pushes):
        now = PlanningState.at_rest(jnp.asarray(x)[None])
        if number % 2:
            action = jnp.asarray(task.actions.sample(rng, x, PARKED_POSE, 1))
        else:
            action = task.policy.act(task.policy.prepare(x, goal), now).mean
        allowed = np.asarray(task.actions.project(action, now))[0]
        seen.append(table.push(task.actions.motion(allowed, PARKED_POSE, Site()), x))
        x = seen[-1].after
    return seen


def grid(task: Task, points: int) -> list[dict[str, float]]:
    """Grid of the calibrated parameters, `points` of each from 0.3 to 3.3 times the nominal."""
    names = task.calibrated
    nominal = nominal_model(task.name)
    factors = np.meshgrid(*[np.geomspace(0.3, 3.3, points)] * len(names), indexing="ij")
    rows = np.stack([factor.ravel() for factor in factors], axis=1)
    specs = task.parameters(stiff=False)
    bounds = {name: specs[index(name)] for name in names}
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
    """Fit to `episodes` from both wrong corners, and compare with the grid on as many others, in four divisions."""
    data = load(task)
    count = data.preset(preset).particle_count
    drawn = [_gathered(data, episode(data, seed, pushes, count)) for seed in range(2 * episodes)]
    print(f"{len(drawn)} episodes of {pushes} pushes", flush=True)
    predictor, phi = ModelScorer(advance=advance(task, count), chunk=8), phi_of(nominal_model(task))
    still_m2 = np.array([_mean(ModelScorer(advance=lambda _phi, x, _tool: x, chunk=8), phi, part) for part in drawn])
    points = grid(data, grid_points)
    scores_m2 = np.array([[_mean(predictor, with_values(phi, values), part) for part in drawn] for values in points])
    rows: list[dict[str, object]] = []
    for name, known, held_out in _divisions(2 * episodes):
        grid_m2 = scores_m2[:, held_out].mean(1)
        best = int(np.argmin(grid_m2))
        print(
            f"fit to {name}; held out: no motion {still_m2[held_out].mean():.3e} m^2, best on the grid "
            f"{grid_m2[best]:.3e} {points[best]}"
        )
        for start in (factor, 1 / factor):
            row = _fitted(data, predictor, phi, _joined(drawn, known), _joined(drawn, held_out), start)
            rows.append({"fitted_to": name, **row, "over_grid": row["held_out_m2"] / grid_m2[best]})
            print(json.dumps(rows[-1]), flush=True)
    over = [cast(float, row["over_grid"]) for row in rows]
    print(f"held-out loss over the best on the grid: median {np.median(over):.3f}, {min(over):.3f} to {max(over):.3f}")
    if out is not None:
        out.write_text(json.dumps(rows))


def _divisions(count: int) -> list[tuple[str, list[int], list[int]]]:
    """Halves of the episodes: the fitted ones, by name and number, and those held out."""
    everything = list(range(count))
    first, even = everything[: count // 2], everything[::2]
    second, odd = everything[count // 2 :], everything[1::2]
    return [
        ("the first half", first, second),
        ("the second half", second, first),
        ("the even ones", even, odd),
        ("the odd ones", odd, even),
    ]


def _gathered(task: Task, seen: list[Transition]) -> Evidence:
    return gather(seen, task.actions.measured_path)


def _joined(drawn: list[Evidence], episodes: list[int]) -> Evidence:
    chosen = [drawn[number] for number in episodes]
    return Evidence(
        before=np.concatenate([part.before for part in chosen]),
        tool=np.concatenate([part.tool for part in chosen]),
        after=np.concatenate([part.after for part in chosen]),
    )


def _fitted(
    data: Task,
    predictor: ModelScorer,
    phi: Float32[np.ndarray, " P"],
    known: Evidence,
    held_out: Evidence,
    factor: float,
) -> dict[str, float]:
    """Fit from every calibrated parameter wrong by `factor`."""
    every = data.parameters(stiff=False)
    specs = tuple(every[index(name)] for name in data.calibrated)
    wrong = {spec.name: spec.value(spec.coordinate(float(phi[index(spec.name)]) * factor)) for spec in specs}
    calibrator = Calibrator(predictor=predictor, specs=specs, settings=FitSettings())
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    found = calibrator.fit(known, with_values(phi, wrong))
    wall_s, cpu_s = time.perf_counter() - wall_s, time.process_time() - cpu_s
    values = dict(zip(data.calibrated, map(float, found.values), strict=True))
    low, high = (dict(zip(data.calibrated, map(float, end), strict=True)) for end in (found.low, found.high))
    row = {"factor": factor, "trials": len(found.trials), "wall_s": wall_s, "cpu_s": cpu_s}
    row |= values | {f"{name} low": low[name] for name in low} | {f"{name} high": high[name] for name in high}
    return row | {"fitted_m2": found.loss_m2, "held_out_m2": _mean(predictor, with_values(phi, values), held_out)}


def _mean(predictor: ModelScorer, phi: Float32[np.ndarray, " P"], evidence: Evidence) -> float:
    """Mean one-step Chamfer distance [m^2]; infinite where the simulation fails."""
    losses = predictor.losses(phi, evidence)
    return float(losses.mean()) if np.isfinite(losses).all() else float("inf")


if __name__ == "__main__":
    tyro.cli(main)
