"""Tasks with an object that a user describes: its kind, its colours, its sizes and what is known of its parameters."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from app.core.colours import ColourRange
from app.core.errors import ParameterError, UsageError
from app.core.geometry.object_description import CLOTH_SIZES, LIQUID_SIZES, ObjectDescription
from app.core.geometry.scene_description import Cloth, Liquid
from app.core.messages import Parameter
from app.discovery.inference.screen import prior_of
from app.discovery.inference.weighing import CALIBRATED
from app.discovery.residuals.sensitivity import steps_of
from app.jobs.discovery_subject import subject_of
from app.jobs.worker_api import check_model, nominal_model
from app.rig.simulated.kinds import kind_of
from app.tasks import load, names
from app.tasks.elements.descriptions import check_object, object_type, with_appearance

FRICTION = Parameter(name="table_friction", value=0.3, unit="1", low=0.2, high=0.45)
GREEN = (0.1, 0.5, 0.2)


def test_an_object_of_another_kind_is_refused_with_the_tasks_that_have_one():
    with pytest.raises(UsageError, match=r"'beans', and rope_push has 'rope'; .*bean_sweep"):
        check_object(load("rope_push"), ObjectDescription(kind="beans"), map(load, names()))
    with pytest.raises(UsageError, match="one of its own"):
        check_object(load("pour_soup"), ObjectDescription(kind="liquid"), ())
    for name in names():
        check_object(load(name), ObjectDescription(kind=object_type(load(name))), ())


@pytest.mark.parametrize(
    ("prior", "said"),
    [
        (replace(FRICTION, name="table_fricton"), "Did you mean 'table_friction'"),
        (replace(FRICTION, name="adhesion"), "Known: finger_friction, stiffness, table_friction"),
        (replace(FRICTION, unit="N"), "give it in '1'"),
        (replace(FRICTION, high=9.0), "high = 9"),
    ],
)
def test_priors_are_of_parameters_that_the_task_has_in_their_units_and_ranges(prior: Parameter, said: str):
    with pytest.raises(ParameterError, match=said):
        check_object(load("rope_push"), ObjectDescription(priors=(prior,)), ())
    check_object(load("rope_push"), ObjectDescription(priors=(FRICTION, replace(FRICTION, unit=""))), ())


def test_colours_change_what_the_cell_shows_and_what_cameras_look_for():
    task = load("rope_push")
    assert with_appearance(task, None) is task
    green = with_appearance(task, ObjectDescription(colour=GREEN))
    assert green.stage.body.colour == GREEN
    assert green.perception.colour == ColourRange.around(GREEN)
    seen = ColourRange.of((90.0, 150.0), (0.2, 1.0), (0.1, 1.0))
    real = with_appearance(task, ObjectDescription(colours=seen))
    assert (real.stage, real.perception.colour) == (task.stage, seen)
    assert with_appearance(load("pour_soup"), ObjectDescription(colour=GREEN)).stage == load("pour_soup").stage


def test_a_session_begins_with_what_is_known_of_the_parameters():
    model = nominal_model("rope_push@rods", (replace(FRICTION, unit=""),))
    check_model(model)
    known = {each.name: each for each in model.parameters}
    assert known["table_friction"] == FRICTION
    usual = {each.name: each for each in nominal_model("rope_push@rods").parameters}
    assert {name for name in known if known[name] != usual[name]} == {"table_friction"}


def test_discovery_begins_there_too_and_trusts_it_as_far_as_its_interval():
    subject = subject_of(load("rope_push@rods"), priors=(FRICTION,))
    known = subject.catalogue()
    about = known.nominal(subject)
    column = known.column("table_friction")
    assert about[column] == pytest.approx(0.3)
    steps = steps_of(known, subject.calibrated, {})
    own = [number for number, step in enumerate(steps) if step.column == column]
    free = [number for number, step in enumerate(steps) if step.column == known.column("stiffness")]
    prior = prior_of(known, subject.calibrated, about, steps)
    # A factor of 2.25 is its interval of 90 %.
    assert prior.variance[own[0]] ** 0.5 * steps[own[0]].size == pytest.approx(np.log(2.25) / 2 / 1.645)
    assert prior.mean[own[0]] == pytest.approx(0, abs=1e-6)
    assert prior.variance[free[0]] == CALIBRATED**2
    moved = about.copy()
    moved[column] = 0.2
    assert prior_of(known, subject.calibrated, moved, steps).mean[own[0]] > 0


@pytest.mark.parametrize(("size_m", "mass_kg"), list(product(*CLOTH_SIZES.values())))
def test_a_cloth_at_the_ends_of_the_ranges_lies_in_its_cell_and_hangs_when_it_is_hung(size_m: float, mass_kg: float):
    task = load(f"cloth_hang(size_m={size_m},mass_kg={mass_kg})")
    body = task.stage.body
    assert isinstance(body, Cloth)
    assert (body.size_m, body.mass_kg) == (size_m, mass_kg)
    start, goal = task.start(0), task.goal(0, 256)
    tool = np.array([0.3, -0.3, 0.3, 0.0, 1.0, 0.0, 0.0, 0.04])
    assert task.is_done(goal, goal, tool)
    (x0, y0, _), (x1, _, _) = task.actions.reach
    assert (start[:, 0] > x0).all()
    assert (start[:, 0] < x1).all()
    assert (start[:, 1] < task.policy.rack_y_m - task.policy.half_m).all()
    assert start[:, 1].max() > y0 + 0.05
    world = kind_of(task.stage).build(task.stage, start, 0.0)
    world.step(world.tool, 0.2)
    assert np.abs(world.nodes() - start).max() < 0.01
    usual = load("cloth_hang")
    assert task.scene.dt_s * task.actions.substeps == pytest.approx(usual.scene.dt_s * usual.actions.substeps, rel=0.01)


def test_a_cloth_without_a_mass_is_of_the_same_stuff():
    body = load("cloth_hang(size_m=0.2)").stage.body
    assert isinstance(body, Cloth)
    assert body.mass_kg == pytest.approx(0.0125 * 0.64)


@pytest.mark.parametrize(("volume_m3", "density_kg_m3"), list(product(*LIQUID_SIZES.values())))
def test_a_liquid_at_the_ends_of_the_ranges_fits_into_both_bowls(volume_m3: float, density_kg_m3: float):
    task = load(f"pour_water(volume_m3={volume_m3},density_kg_m3={density_kg_m3})")
    body = task.stage.body
    assert isinstance(body, Liquid)
    assert (body.volume_m3, task.perception.volume_m3) == (volume_m3, volume_m3)
    (matter,) = task.scene.bodies
    assert matter.volume_m3 * matter.density_kg_m3 == pytest.approx(volume_m3 * density_kg_m3)
    goal, start = task.goal(0, 300), task.start(0)
    assert task.success.is_reached(goal, goal)
    assert not task.success.is_reached(task.particles(start, 300), goal)
    # It is no soup, which has one of its own.
    with pytest.raises(UsageError, match="leave --object out"):
        load(f"pour_soup(volume_m3={volume_m3})")
