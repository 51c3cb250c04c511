"""Discovery on rods: pushes of a rope of any size, simulated as what the recording says it is."""

import inspect
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest

from app.discovery.dataset.model_under_test import catalogue
from app.discovery.residuals import steppers
from app.discovery.residuals.displacement_field import MODES
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.sensitivity import STARTS, residuals
from app.discovery.residuals.simulation_batch import SimulationBatch, prepare
from app.discovery.residuals.steppers import material_coordinates
from app.jobs.discovery_subject import subject_of
from app.policy.random_pushes import PushDesign
from app.sim.model.numerics import ANY_NUMERICS, NUMERICS, ROD_NUMERICS
from app.sim.state import State
from app.tasks import load
from bench.hidden.ropes import RopeCase

CASE = RopeCase(seed=3, plan=PushDesign(episodes=2, pushes=1))
SUBJECT = subject_of(CASE.task)
KNOWN = catalogue(SUBJECT.rods)


@cache
def predictor() -> Predictor:
    return Predictor(SUBJECT, KNOWN)


@cache
def trials() -> SimulationBatch:
    return prepare(CASE.record(), SUBJECT)


def test_a_rope_of_drawn_size_in_another_engine_is_predicted_far_better_than_by_no_motion() -> None:
    seen = predictor()(trials(), [KNOWN.nominal(SUBJECT)])
    for found, observed in ((seen.during[0], trials().observed.during), (seen.after[0], trials().observed.after)):
        for k, push in enumerate(trials().study.pushes):
            moved = np.linalg.norm(_middle(observed[k]) - _middle(push.before.points))
            assert np.linalg.norm(_middle(observed[k]) - _middle(found[k])) < 0.5 * moved


def _middle(points: np.ndarray) -> np.ndarray:
    return points[:, :2].mean(0)


def test_parameters_that_are_equal_predict_the_same_and_each_unknown_of_a_rod_something_else() -> None:
    nominal = KNOWN.nominal(SUBJECT)
    others = [nominal.copy() for _ in ROD_NUMERICS]
    for other, name in zip(others, ROD_NUMERICS, strict=True):
        other[KNOWN.column(name)] = 1.0
    same, again, *changed = predictor()(trials(), [nominal, nominal, *others]).after
    np.testing.assert_array_equal(same, again)
    for name, other in zip(ROD_NUMERICS, changed, strict=True):
        assert 1e-6 < np.abs(other - same).max() < 0.05, name


def test_a_rope_that_is_seen_elsewhere_begins_there_with_its_particles_in_the_same_order() -> None:
    """Places along a rope are found once, from the cloud as it was seen, however cameras are then taken to err."""
    theta = KNOWN.nominal(SUBJECT)
    theta[KNOWN.column("hand_eye_x")] = 0.004
    still = replace(trials(), stops_s=trials().starts_s, ends_s=trials().starts_s)
    one, other = predictor()(still, [KNOWN.nominal(SUBJECT), theta]).after
    np.testing.assert_allclose(other, one, atol=2e-4)


def test_residuals_of_rods_are_means_over_beginnings_that_are_the_same_for_every_model() -> None:
    nominal = KNOWN.nominal(SUBJECT)
    found = residuals(predictor(), trials(), nominal, [], replicas=2)
    assert found.spread.shape[2] == STARTS
    starts = [trials(), *(trials().with_noise(seed) for seed in range(STARTS - 1))]
    ends = np.mean([predictor()(start, [nominal]).after[0] for start in starts], axis=0)
    expected = trials().gap(0, "after", ends[0].astype(np.float32), trials().observed.after[0])
    np.testing.assert_allclose(found.r[0, 2 * MODES : 4 * MODES], expected, atol=1e-5)


def test_residuals_of_rods_are_of_centrelines_and_slopes_what_they_shrink_by() -> None:
    assert trials().rope is not None
    assert prepare(CASE.record(), subject_of(load("rope_push@mpm"))).rope is None
    nominal, other = KNOWN.nominal(SUBJECT), KNOWN.nominal(SUBJECT)
    other[KNOWN.column("table_friction")] *= 1.3
    base, moved = (predictor()(trials(), [theta]).after[0] for theta in (nominal, other))
    for k in range(len(trials())):
        found = trials().amplitudes(k, "after", base[k], (moved[k] - base[k])[None].astype(np.float64))[0]
        gap = trials().gap(k, "after", base[k], moved[k])
        assert np.linalg.norm(found - gap) < 3e-4 + 0.1 * np.linalg.norm(gap)


@pytest.mark.parametrize("name", ["mass_slope", "rest_curvature"])
def test_what_acts_along_a_rope_follows_its_material_whichever_end_is_called_the_first(name: str) -> None:
    """With labels from the other end, an odd effect of the opposite sign is the same effect."""
    column, turned = KNOWN.column(name), -trials().labels
    forth, back = KNOWN.nominal(SUBJECT), KNOWN.nominal(SUBJECT)
    typical = KNOWN.specs[column].typical
    assert typical is not None
    forth[column], back[column] = typical, -typical
    one = predictor()(trials(), [forth]).after[0]
    other = predictor()(replace(trials(), labels=turned), [back]).after[0]
    np.testing.assert_allclose(one, other, atol=1e-4)
    assert np.abs(one - predictor()(trials(), [back]).after[0]).max() > 1e-3


@pytest.mark.parametrize("turned", [False, True])
def test_nodes_have_the_material_coordinates_of_the_particles_around_them(turned: bool) -> None:
    label = np.linspace(-1, 1, 40)[None]
    place = np.linspace(0, 10, 40)[None][:, :: -1 if turned else 1]
    along = np.asarray(material_coordinates(jnp.asarray(place), jnp.asarray(label), 11))[0]
    np.testing.assert_allclose(along, np.linspace(-1, 1, 11)[:: -1 if turned else 1], atol=1e-6)


def test_the_catalogue_of_rods_has_what_acts_on_them_with_every_parameter_in_its_column() -> None:
    of_particles = catalogue()
    names = {cause.name for cause in KNOWN.causes}
    missing = {cause.name for cause in of_particles.causes} - names
    numerics = set(NUMERICS) - set(ROD_NUMERICS)
    assert missing == {"adhesion", "rolling_resistance", *numerics}
    assert names - {cause.name for cause in of_particles.causes} == set(ROD_NUMERICS) - set(NUMERICS)
    for cause in KNOWN.causes:
        if cause.name not in ANY_NUMERICS:
            assert cause.columns == of_particles.cause(cause.name).columns


def test_what_is_a_cause_is_not_fitted_whatever_the_cause() -> None:
    assert SUBJECT.calibrated == ("stiffness", "table_friction")
    assert load("rope_push@rods").calibrated == ("stiffness", "table_friction", "finger_friction")


def test_pieces_that_failed_time_steps_fling_away_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    def make_flinging(*_: object, **_more: object) -> Callable[..., State]:
        def simulate(phi: jnp.ndarray, state: State, *_: object) -> State:
            return state._replace(x=state.x + 1e5 * phi[:, :1, None])

        return simulate

    monkeypatch.setattr(steppers, "make_rollout", make_flinging)
    monkeypatch.setattr(steppers, "_particle_stepper", inspect.unwrap(vars(steppers)["_particle_stepper"]))
    subject = subject_of(load("bean_sweep"))
    begun = np.broadcast_to(np.array([0.5, 0.0, 0.01], np.float32), (2, subject.particle_count, 3))
    phi = np.zeros((2, len(subject.nominal)), np.float32)
    phi[1] = 1.0
    tool = np.zeros((2, steppers.BLOCK + 1, subject.tool_coordinates), np.float32)
    label, time, needed = np.zeros((2, subject.particle_count, 4), np.float32), np.zeros(2, np.float32), np.ones((2, 2))
    stopped, end = steppers.stepper(subject).move(phi, phi, (begun,), label, time, tool, tool, needed)
    for found in (stopped, end):
        np.testing.assert_array_equal(np.asarray(found[0]), begun[0])
        assert np.isnan(np.asarray(found[1])).all()


def test_a_cloth_that_is_lifted_by_its_corner_is_not_flung_away() -> None:
    lying = jnp.stack([jnp.linspace(0.0, 0.3, 4), jnp.zeros(4), jnp.zeros(4)], axis=1)[None]
    hanging = jnp.stack([jnp.zeros(4), jnp.zeros(4), jnp.linspace(0.3, 0.0, 4)], axis=1)[None]
    upwards = jnp.stack([jnp.zeros(5), jnp.zeros(5), jnp.linspace(0.0, 0.3, 5)], axis=1)[None]
    assert not steppers.is_flung(lying, hanging, upwards)[0]
    assert steppers.is_flung(lying, hanging + 1.0, upwards)[0]
