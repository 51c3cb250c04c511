"""Models extended by any cause of any task's catalogue are read, planned with, and fitted to what happened.

That plans with them are better is measured where it is a rope (`test_extended_plans.py`), and by `bench.stories`.
"""

from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from app.config import Site
from app.core.messages import Executed, Model, Parameter, Transition, fresh_id
from app.core.types import Points, ToolPose
from app.discovery.dataset.model_under_test import Catalogue, Cause, Subject
from app.jobs.apparatus_compensation import correction
from app.jobs.discovery_subject import subject_of
from app.jobs.extended import Covariance, extended_model
from app.jobs.worker_api import check_model, plan, planner_needs, shown_goal, true_positions, update
from app.recording.exchange.model_file import load_model, save_model
from app.rig.simulated.kinds import kind_of
from app.sim.model.numerics import ANY_NUMERICS
from app.sim.parameter import ParameterSpec
from app.tasks import load
from app.tasks.elements.base import Task

TASKS = ("bean_sweep", "cloth_hang", "pour_soup", "pour_water")
HALF = 0.5
"""Share of a typical size, so that all causes together leave an object where it can be simulated."""


@cache
def known(name: str) -> tuple[Subject, Catalogue]:
    subject = subject_of(load(name))
    return subject, subject.catalogue()


def causes(*families: str) -> Iterator[tuple[str, str]]:
    for name in TASKS:
        for cause in known(name)[1].causes:
            if cause.family in families and cause.name not in ANY_NUMERICS:
                yield name, cause.name


APPARATUS = sorted(causes("sensing", "actuation"))


def found(name: str, *asked: Cause) -> Model:
    """The model that a discovery would write where these causes were found."""
    subject, catalogue = known(name)
    specs = [catalogue.specs[column] for cause in asked for column in cause.columns]
    nominal = catalogue.nominal(subject)
    values = tuple(
        Parameter(name=spec.name, unit=spec.unit, value=value, low=value, high=value)
        for spec in specs
        for value in [_off(spec, float(nominal[catalogue.column(spec.name)]))]
    )
    return extended_model(
        name,
        values,
        effects=[cause.name for cause in asked],
        covariance=Covariance((), np.zeros((0, 0))),
        recordings={},
        camera_m=(0.55, -0.25, 0.95),
        pushes=1,
        time_s=0.0,
    )


def _off(spec: ParameterSpec, nominal: float) -> float:
    if spec.typical is None:
        return nominal
    either = [spec.value(spec.coordinate(nominal) + side * HALF * spec.typical) for side in (1.0, -1.0)]
    return next(value for value in either if value != nominal)


def scene(task: Task) -> tuple[Points, ToolPose]:
    """The object at the start of a problem, and the waiting tool."""
    return task.particles(task.start(0), task.preset("cpu").particle_count), kind_of(task.stage).home(
        task.stage, task.start(0)
    )


@pytest.mark.parametrize(("name", "cause"), APPARATUS)
def test_what_cameras_and_arm_get_wrong_is_written_read_and_allowed_for(name: str, cause: str, tmp_path: Path) -> None:
    task, model = load(name), found(name, known(name)[1].cause(cause))
    save_model(tmp_path / "model.toml", model)
    read = load_model(tmp_path / "model.toml", task=name, time_s=0.0)
    check_model(read)
    assert read.apparatus
    error, (x, tool) = correction(read), scene(task)
    true = error.true_tool(tool)
    seen = true_positions(x, read, tool)
    assert np.isfinite(seen).all()
    assert np.isfinite(shown_goal(task.goal(0, len(x)), read)).all()
    action = task.actions.sample(np.random.default_rng(0), seen, true, 1)[0]
    motion = task.actions.motion(action, true, Site())
    told = error.command(motion, seen, seen, Site())
    if motion.continues:  # The arm would not make it from elsewhere.
        np.testing.assert_allclose(told.positions[0], tool[:3], atol=1e-6)
    made = error.executed_path(told.positions, error._drag_load(motion, seen, seen), motion.poses[:, 3:7])
    mended = told.positions[:, 2] > Site().limits.workspace.low[2]
    mended[0] &= not motion.continues
    np.testing.assert_allclose(made[mended], motion.positions[mended], atol=1e-5)


@cache
def erring(name: str) -> Model:
    """The model of all causes of the catalogue at once."""
    return found(name, *(cause for cause in known(name)[1].causes if cause.name not in ANY_NUMERICS))


@pytest.mark.parametrize("name", TASKS)
def test_a_planner_is_compiled_for_every_physics_of_the_catalogue(name: str) -> None:
    physics = {cause.name for cause in known(name)[1].causes if cause.family == "physics"}
    first = {known(name)[1].specs[known(name)[1].cause(cause).columns[0]].name for cause in physics}
    assert first <= set(planner_needs(erring(name)))


@pytest.mark.slow
@pytest.mark.parametrize("name", TASKS)
def test_all_causes_at_once_are_planned_with_and_fitted(name: str) -> None:
    task, model = load(name), erring(name)
    x, tool = scene(task)
    goal = task.goal(0, len(x))
    chosen = plan(name, "cpu", x, goal, model, 0, tool=tool)
    assert np.isfinite(chosen.predicted).all()
    times = np.linspace(0.0, 1.0, len(chosen.motion.poses))
    poses = chosen.motion.poses
    executed = Executed(
        id=fresh_id("executed"),
        time_s=1.0,
        approved_id=fresh_id("approved"),
        outcome="completed",
        reason="",
        times_s=times,
        commanded=poses[:, :7],
        measured=poses[:, :7],
        openings=poses[:, 7],
    )
    transition = Transition(id=fresh_id("transition"), time_s=2.0, before=x, executed=executed, after=chosen.predicted)
    fitted = update(name, "cpu", [transition], model)
    assert fitted.version == model.version + 1
    assert fitted.apparatus == model.apparatus
    assert fitted.extension.effects == model.extension.effects
