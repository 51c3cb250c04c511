"""Value of the known cause to a planner: `python -m bench.hidden.planned ORDERS.json --model A.toml B.toml`.

Single pushes to goals that one push of the world can reach, planned with the nominal model, with each of these, and
with the truth, and made in our own engine with other numerics and the effects of ORDERS.json (`bench.hidden.own`).
The gain of a model is a share of the truth's: the reduction of the summed Chamfer distances to the goals, over that
by the truth. Effects that grow with a session stand still here.
"""

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import final

import numpy as np
from jaxtyping import Float64
from rich.console import Console
from rich.table import Table

from app.config import Site
from app.core.geometry.chamfer import chamfer_m2
from app.core.geometry.track import Track
from app.core.messages import Model
from app.core.motion import TOOL_DOWN, Motion
from app.core.types import Points
from app.discovery.dataset.labels import label_particles
from app.discovery.dataset.model_under_test import Theta, catalogue
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.simulation_batch import prepare
from app.discovery.sensor_actuator_errors.base import Eye
from app.jobs import jit_cache
from app.jobs.apparatus_compensation import correction
from app.jobs.discovery_subject import subject_of
from app.jobs.extended import extended_model, fitted_parameters
from app.jobs.worker_api import nominal_model
from app.planner.search.plan import Plan, TreePlanner
from app.planner.search.request import PlanRequest
from app.planner.search.tree import TreeConfig
from app.policy.base import PARKED_POSE
from app.recording.exchange.model_file import load_model
from app.sim.model.params import acting
from app.tasks import load
from app.tasks.elements.curves import fill_tube
from bench.hidden.own import read_orders, world_of
from bench.own_world import CAMERA_M, finer

_TASK = "rope_push"
_PRESET = "cpu"
_BRANCHES, _STEPS = 6, 8
PROBLEMS = 5


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Bench:
    """A world in which `truth` holds, and pushes in it. Objects are where they truly are [m]."""

    truth: Theta

    @cached_property
    def predictor(self) -> Predictor:
        return Predictor(subject_of(load(_TASK)), catalogue())

    def seen(self, x: Points) -> Points:
        """Object as its cameras observe it."""
        return self.predictor.observe(x, _eye(x), self.truth)

    def after(self, x: Points, motion: Motion, *, obeyed: bool = False) -> Points:
        """Object after the arm is given this motion; `obeyed`: by an arm and cameras without error."""
        theta = self.truth.copy()
        if obeyed:
            for effect, first in self.predictor.catalogue.apparatus:
                theta[first : first + len(effect.parameters)] = 0.0  # Their null.
        track = _track(motion)
        shown = x if obeyed else self.seen(x)
        end = shown
        for _ in range(2):  # What a tool that gives way feels depends on where the object goes.
            push = Push(
                episode=0,
                before=ProjectionView(time_s=0.0, points=shown),
                during=(),
                after=ProjectionView(time_s=track.end_s, points=end),
                command=track,
                measured=None,
            )
            study = Study(task=_TASK, pushes=(push,), tables={}, camera=CAMERA_M)
            trials = prepare(study, self.predictor.subject)
            world = replace(self.predictor.subject, scene=finer(self.predictor.subject.scene))
            end = self.predictor(trials, [theta], subject=world).after[0, 0]
        return end if obeyed else self.predictor.unproject(end, _eye(x), self.truth).astype(np.float32)


def planned(model: Model, observed: Points, goal: Points, seed: int) -> Plan:
    """One push by this model, of a smaller search than the task's presets, one push deep."""
    task, phi = load(_TASK), jit_cache.phi_of(model)
    search = TreeConfig(
        space=task.actions,
        policy=task.policy,
        weights=task.weights,
        advance=jit_cache.action_simulator(_TASK, task.preset(_PRESET).particle_count, acting(phi)),
        branches=_BRANCHES,
        depth=1,
    )
    planner = TreePlanner(search=search, descent=task.descent, gradient_steps=_STEPS)
    request = PlanRequest(observed=observed, goal=goal, phi=phi, seed=seed)
    return correction(model).plan(planner, request) if model.apparatus else planner(request)


def reached_m2(bench: Bench, models: Sequence[Model], problems: int) -> Float64[np.ndarray, "Q J"]:
    """The Chamfer distance to each goal after the push that each model plans [m^2], one row a model."""
    task = load(_TASK)
    rows = np.full((len(models), problems), math.nan)
    for number in range(problems):
        x = fill_tube(task.start(100 + number), task.rope.radius_m, task.preset(_PRESET).particle_count)
        action = task.actions.sample(np.random.default_rng(number), x, PARKED_POSE, 1)[0]
        goal = bench.after(x, task.actions.motion(action, PARKED_POSE, Site()), obeyed=True)
        for row, model in enumerate(models):
            plan = planned(model, bench.seen(x), goal, number)
            rows[row, number] = float(chamfer_m2(bench.after(x, plan.motion), goal))
    return rows


def truth_of(theta: Theta) -> Model:
    """The model that knows the world but for its numerics."""
    known = catalogue()
    values, covariance = fitted_parameters(known, known.nominal(subject_of(load(_TASK))), theta, (), np.zeros((0, 0)))
    return extended_model(
        _TASK,
        values,
        effects=(),
        covariance=covariance,
        recordings={},
        camera_m=CAMERA_M,
        pushes=0,
        time_s=0.0,
    )


def _eye(points: Points) -> Eye:
    return Eye(np.asarray(CAMERA_M), label_particles([points])[1][0].astype(np.float64))


def _track(motion: Motion) -> Track:
    lengths = np.linalg.norm(np.diff(motion.positions, axis=0), axis=1)
    times = np.concatenate([[0.0], np.cumsum(np.maximum(lengths / motion.speeds[1:], 1e-3))])
    poses = np.concatenate([motion.positions, np.tile(TOOL_DOWN, (len(times), 1))], axis=1)
    return Track(times_s=times, poses=poses)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("orders", type=Path)
    parser.add_argument("--nominal", type=Path, help="a calibrated model; else the task's own")
    parser.add_argument("--model", type=Path, nargs="+", required=True, help="one for each order")
    parser.add_argument("--problems", type=int, default=PROBLEMS)
    options = parser.parse_args()
    plain = nominal_model(_TASK) if options.nominal is None else load_model(options.nominal, task=_TASK, time_s=0.0)
    table = Table(title="Chamfer distance to the goals after one push, summed [mm^2]")
    for column in ("world", "nominal", "extended", "truth", "share of the truth's gain"):
        table.add_column(column)
    for order, path in zip(read_orders(options.orders), options.model, strict=True):
        theta = world_of(order, catalogue(), subject_of(load(_TASK))).theta
        models = (plain, load_model(path, task=_TASK, time_s=0.0), truth_of(theta))
        sums = 1e6 * reached_m2(Bench(truth=theta), models, options.problems).sum(1)
        share = (sums[0] - sums[1]) / (sums[0] - sums[2]) if sums[2] < sums[0] else math.nan
        table.add_row(order.name, *(f"{value:.0f}" for value in sums), f"{share:.2f}")
        Console(stderr=True).print(f"{order.name}: {sums.round()} {share:.2f}")
    Console().print(table)


if __name__ == "__main__":
    main()
