"""Comparison of rope materials: `python -m bench.rope`.

Random pushes of the MuJoCo world, seen exactly, and predicted one by one by the task's scene with ropes of several
materials, each with the stiffness and friction that fit these pushes. The error is the mean length of the displacement
field between the predicted and the true rope, as in discovery.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Float64
from rich.console import Console
from rich.table import Table

from app.discovery.dataset.model_under_test import Subject, catalogue
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.inference.screen import refit
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.simulation_batch import SimulationBatch, prepare
from app.discovery.results.gain import error_mm
from app.jobs.discovery_subject import subject_of
from app.policy.random_pushes import PushDesign
from app.rig.simulated.push_session import StampedSnapshot
from app.rig.simulated.worlds.physics import WorldPhysics
from app.sim.materials.base import Material
from app.sim.materials.elastic import Elastic
from app.sim.materials.rope import RopeMaterial
from app.sim.model.scene import Scene
from app.tasks import load
from app.tasks.elements.curves import fill_tube
from bench.rehearsal import rehearse

SEEDS = (1, 2, 3)
PLAN = PushDesign(episodes=3, pushes=6)
TASK = load("rope_push")
ROPE = RopeMaterial(fibre_pa=2.5e5, core_m=0.004, yield_strain=0.1)
"""Yields at the moment at which the world's hinges do: 0.3 mN m, times the task's scale of gravity."""
DAMPING_1_S = 4.0
"""The task's, too. The 20 that it had with the elastic rope are a fifth of the friction that the moving rope feels."""


def study(seed: int) -> Study:
    """Pushes of the nominal world."""
    takes = rehearse(TASK, PLAN, WorldPhysics(), (), seed)
    pushes = [
        Push(
            episode=take.episode,
            before=_view(take.before),
            during=(_view(take.during),),
            after=_view(take.after),
            command=take.command,
            measured=take.measured,
        )
        for take in takes
    ]
    return Study(task=TASK.name, pushes=tuple(pushes))


def _view(look: StampedSnapshot) -> ProjectionView:
    points = fill_tube(look.snapshot.nodes, TASK.rope.radius_m, TASK.preset("cpu").particle_count)
    return ProjectionView(time_s=look.stamp_s, points=points)


def scenes() -> Iterator[tuple[str, Scene]]:
    """The task's with another rope."""
    (body,) = TASK.scene.bodies

    def made(material: Material) -> Scene:
        return replace(TASK.scene, bodies=(replace(body, material=material),), damping_1_s=DAMPING_1_S)

    yield "the task's", TASK.scene
    yield "elastic", made(Elastic())
    yield "elastic with fibres", made(replace(ROPE, yield_strain=1e3))
    yield "yields, without fibres", made(replace(ROPE, fibre_pa=0.0))
    yield "fibres in matter that yields", made(ROPE)


def errors_mm(subject: Subject, trials: SimulationBatch) -> tuple[Float64[np.ndarray, " K"], Float64[np.ndarray, " P"]]:
    """Errors of the refitted model on each push; and that model."""
    predictor = Predictor(subject, catalogue())
    theta = refit(predictor, trials)
    ends = predictor(trials, [theta]).after[0]
    return np.array([error_mm(trials, k, cloud) for k, cloud in enumerate(ends)]), theta


def main() -> None:
    """A row a material, over the pushes of all seeds."""
    subject, studies = subject_of(TASK), [study(seed) for seed in SEEDS]
    still = [
        error_mm(trials, k, push.before.points)
        for trials in (prepare(each, subject) for each in studies)
        for k, push in enumerate(trials.study.pushes)
    ]
    pushes = len(SEEDS) * PLAN.episodes * PLAN.pushes
    table = Table(title=f"One-step error of {pushes} pushes; the rope moves by {np.mean(still):.1f} mm")
    for column in ("the rope is", "mean, mm", "median, mm", "nine of ten below, mm", "stiffness, Pa", "table friction"):
        table.add_column(column)
    for name, scene in scenes():
        own = replace(subject, scene=scene)
        found = [errors_mm(own, prepare(each, own)) for each in studies]
        errors, thetas = np.concatenate([each[0] for each in found]), np.array([each[1][:2] for each in found])
        numbers = [errors.mean(), np.median(errors), np.quantile(errors, 0.9)]
        fitted = [", ".join(f"{value:.3g}" for value in column) for column in thetas.T]
        table.add_row(name, *(f"{number:.1f}" for number in numbers), *fitted)
    Console().print(table)


if __name__ == "__main__":
    main()
