"""At the ends of the ranges of sizes a rod is simulated as truly as a nominal rope: shorter steps change as little."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.core.geometry.object_description import SIZES
from app.core.geometry.track import Track
from app.discovery.dataset.model_under_test import catalogue
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.simulation_batch import prepare
from app.jobs.discovery_subject import subject_of
from app.tasks import load
from app.tasks.elements.base import Task
from app.tasks.elements.curves import fill_tube

LONGEST, THICKEST = SIZES["length_m"][1], SIZES["radius_m"][1]
_DENSITY = 0.064 / (0.4 * 0.008**2)


def pushes_across(task: Task) -> Study:
    """Two pushes of 6 cm across a nearly straight rope, at its middle and beyond, at 0.15 m/s."""
    rope, made = task.rope, list[Push]()
    along = np.linspace(-rope.length_m / 2, rope.length_m / 2, 81)
    line = np.stack([0.55 + 0.02 * np.sin(6 * along / rope.length_m), along, np.full(81, rope.radius_m)], 1)
    x = fill_tube(line, rope.radius_m, 300)
    for number, share in enumerate((0.0, 0.3)):
        times = np.arange(0, 1.8, 0.02)
        ahead = 0.49 + np.clip(0.15 * (times - 0.3), 0, 0.12)
        height = np.where((times < 0.2) | (times > 1.3), 0.1, task.finger.push_height_m)
        place = np.stack([ahead, np.full(len(times), share * rope.length_m), height], axis=1)
        turned = np.tile([0.0, 1.0, 0.0, 0.0], (len(times), 1))
        track = Track(times_s=100 * number + times, poses=np.concatenate([place, turned], axis=1))
        before = ProjectionView(time_s=100 * number - 0.1, points=x)
        after = ProjectionView(time_s=track.end_s + 0.5, points=x)
        made.append(Push(episode=number, before=before, during=(), after=after, command=track, measured=track))
    return Study(task="rope_push", pushes=tuple(made))


@cache
def error_m(sizes: str) -> float:
    """Mean change of where a rope of these sizes ends by time steps that are a quarter as long."""
    task = load(f"rope_push({sizes})@rods" if sizes else "rope_push@rods")
    subject, study = subject_of(task), pushes_across(task)
    assert subject.rods is not None
    ends = list[np.ndarray]()
    for share in (1.0, 0.25):
        scene = replace(subject.rods.scene, dt_s=share * subject.rods.scene.dt_s)
        finer = replace(subject, rods=replace(subject.rods, scene=scene))
        known = catalogue(finer.rods)
        ends.append(Predictor(finer, known)(prepare(study, finer), [known.nominal(finer)]).after[0])
    assert np.isfinite(ends).all()
    moved = np.linalg.norm(ends[1] - study.pushes[0].before.points, axis=-1)
    assert moved.mean() > 0.01
    return float(np.sqrt(((ends[0] - ends[1]) ** 2).sum(-1).mean()))


@pytest.mark.slow
@pytest.mark.parametrize(
    "sizes",
    [
        f"length_m={LONGEST},mass_kg={_DENSITY * LONGEST * 0.008**2:.4f}",
        f"radius_m={THICKEST},mass_kg={_DENSITY * 0.4 * THICKEST**2:.4f}",
    ],
)
def test_ropes_at_the_ends_of_the_ranges_are_simulated_truly(sizes: str) -> None:
    assert error_m(sizes) < 2 * error_m("")


@pytest.mark.parametrize("name", [name for name in SIZES if name != "finger_yaw_rad"])
def test_a_task_of_either_end_of_a_range_can_be_begun(name: str) -> None:
    for end in SIZES[name]:
        task = load(f"rope_push({name}={end})@rods")
        assert np.isfinite(task.start(0)).all()
