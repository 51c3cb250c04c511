"""Model under test for a rope: the simulator of stiff rods if the pushes are of one, else the usual one."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.errors import UsageError
from app.discovery.dataset.model_under_test import catalogue
from app.discovery.dataset.study import Study
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.simulation_batch import prepare
from app.jobs.discovery_subject import doubted_in, subject_of
from app.policy.random_pushes import PushDesign
from app.sim.model.params import index
from app.tasks import load
from bench.hidden.ropes import RopeCase

CASE = RopeCase(seed=7001, plan=PushDesign(episodes=2, pushes=3))
STIFFNESS = index("stiffness")


@pytest.fixture(scope="module")
def study() -> Study:
    return CASE.record()


def test_stiff_rods_begin_where_the_usual_ones_end_and_go_on_farther() -> None:
    usual, stiff = subject_of(CASE.task), subject_of(CASE.task, stiff=True)
    ranges = [catalogue(subject.rods).specs[STIFFNESS] for subject in (usual, stiff)]
    assert ranges[0].high <= stiff.nominal[STIFFNESS] < 1.05 * ranges[0].high
    assert ranges[1].high > 5 * ranges[0].high
    np.testing.assert_array_equal(np.delete(usual.nominal, STIFFNESS), np.delete(stiff.nominal, STIFFNESS))


def test_pushes_of_a_limp_rope_doubt_the_usual_simulator(study: Study) -> None:
    subject, usual = doubted_in(study, CASE.task).subject, subject_of(CASE.task)
    assert subject.rods == usual.rods
    np.testing.assert_array_equal(subject.nominal, usual.nominal)


@pytest.mark.slow
def test_pushes_of_a_rope_that_is_stiffer_than_that_bears_doubt_the_one_of_stiff_rods(study: Study) -> None:
    stiff = subject_of(CASE.task, stiff=True)
    known = catalogue(stiff.rods)
    truth = known.nominal(stiff)
    truth[STIFFNESS] *= 6
    after = Predictor(stiff, known)(prepare(study, stiff), [truth]).after[0]
    assert np.isfinite(after).all()
    pushes = tuple(
        replace(push, during=(), after=replace(push.after, points=cloud))
        for push, cloud in zip(study.pushes, after, strict=True)
    )
    found = doubted_in(replace(study, pushes=pushes), CASE.task).subject
    assert found.rods == stiff.rods
    assert found.nominal[STIFFNESS] >= stiff.nominal[STIFFNESS]


def test_a_soup_is_a_liquid_of_pieces_and_broth_each_with_its_particles() -> None:
    soup, water = subject_of(load("pour_soup")), subject_of(load("pour_water"))
    assert (soup.kind.name, water.kind.name) == ("soup", "liquid")
    assert soup.kind.is_poured
    assert soup.scene.split(soup.particle_count) == (239, 61)
    assert soup.bowls is not None
    assert soup.bowls.volume_m3 == pytest.approx(96e-6 + 6 * 0.016**3)
    # 10 and 20 kPa; the planner's pieces are softened, for longer time steps.
    assert soup.scene.bodies[1].stiffness * soup.nominal[STIFFNESS] == pytest.approx(15e3)
    assert soup.scene.dt_s < load("pour_soup").scene.dt_s
    assert soup.mass_kg == pytest.approx(0.096 + 3 * 0.016**3 * (900 + 700))


def test_a_soup_that_is_swept_is_refused_as_another_task_than_those_that_are_read() -> None:
    sweeps = load("bean_sweep")
    swept = replace(load("pour_soup"), actions=sweeps.actions, presets=sweeps.presets)
    with pytest.raises(UsageError, match="carries of a cloth and pours; pour_soup is another task"):
        subject_of(swept)
