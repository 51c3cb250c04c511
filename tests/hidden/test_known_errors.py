"""Known errors in recordings: what discovery models takes them away again, and nothing else is changed."""

import numpy as np
import pytest

from app.core.errors import UsageError
from app.core.geometry.track import Track
from app.discovery.dataset.labels import label_particles
from app.discovery.dataset.model_under_test import Catalogue, catalogue
from app.discovery.dataset.study import Study
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.simulation_batch import prepare
from app.discovery.sensor_actuator_errors.base import Eye, Load
from app.jobs.discovery_subject import subject_of
from app.policy.random_pushes import PushDesign
from bench.half_real import described, orders, outcome_of, summary
from bench.hidden.known_errors import UNDONE, effect_of, with_error
from bench.hidden.ropes import RopeCase
from bench.hidden.verdicts import Verdict

CASE = RopeCase(seed=7001, plan=PushDesign(episodes=2, pushes=2))
SEEN = {
    "depth_bias": [0.004],
    "depth_scale": [0.02],
    "hand_eye_rotation": [0.6, -0.4, 0.5],
    "hand_eye_translation": [0.008, -0.003, 0.002],
    "mask_erosion": [0.0015],
}
DRIVEN = {
    "backlash": [0.004],
    "command_delay": [0.1],
    "tcp_offset": [0.008, -0.015, 0.002],
    "under_reach": [-0.05],
}


@pytest.fixture(scope="module")
def study() -> Study:
    return CASE.record()


def at(known: Catalogue, theta: np.ndarray, name: str, values: list[float]) -> np.ndarray:
    changed = theta.copy()
    changed[list(known.cause(name).columns)] = values
    return changed


@pytest.mark.parametrize("name", UNDONE)
def test_an_arm_with_the_error_goes_where_it_went_when_it_is_told_what_the_recording_then_says(
    study: Study, name: str
) -> None:
    values = np.array(DRIVEN[name])
    drive = effect_of(name).drive
    assert drive is not None
    for push, wrong in zip(study.pushes, with_error(study, name, values).pushes, strict=True):
        made = drive(wrong.command, Load(np.zeros((len(wrong.command.times_s), 3))), values)
        np.testing.assert_allclose(made.at(push.command.times_s), push.command.positions, atol=1e-9)
        assert farthest(push.command, wrong.command) > 1e-3


def farthest(one: Track, other: Track) -> float:
    return float(np.abs(one.at(one.times_s) - other.at(one.times_s)).max())


def test_an_arm_measures_what_it_did_unless_its_tool_is_elsewhere_than_it_knows(study: Study) -> None:
    for name, values in DRIVEN.items():
        for push, wrong in zip(study.pushes, with_error(study, name, np.array(values)).pushes, strict=True):
            assert push.measured is not None
            assert wrong.measured is not None
            same = np.array_equal(push.measured.poses, wrong.measured.poses)
            assert same == (name != "tcp_offset")


@pytest.mark.parametrize("name", SEEN)
def test_what_cameras_show_of_the_object_is_where_it_was_once_the_error_is_known(study: Study, name: str) -> None:
    subject = subject_of(CASE.task)
    predictor = Predictor(subject, catalogue(subject.rods))
    theta = at(predictor.catalogue, predictor.catalogue.nominal(subject), name, SEEN[name])
    for push, wrong in zip(study.pushes, with_error(study, name, np.array(SEEN[name])).pushes, strict=True):
        middle = label_particles([wrong.before.points])[1][0].astype(np.float64)
        found = predictor.unproject(wrong.before.points, Eye(np.asarray(study.camera), middle), theta)
        assert np.abs(wrong.before.points - push.before.points).max() > 1e-3
        assert np.sqrt(((found - push.before.points) ** 2).mean()) < 2e-4


def test_images_that_are_younger_than_their_stamps_were_stamped_too_early(study: Study) -> None:
    for push, wrong in zip(study.pushes, with_error(study, "camera_time_offset", np.array([0.03])).pushes, strict=True):
        assert wrong.during[0].time_s == pytest.approx(push.during[0].time_s - 0.03)
        assert wrong.command is push.command


def test_what_cannot_be_put_into_recordings_is_said_with_what_can(study: Study) -> None:
    with pytest.raises(UsageError, match="backlash"):
        with_error(study, "tool_compliance", np.array([0.02]))


def test_a_mask_that_loses_a_rim_shows_a_pushed_object_thinner_and_where_it_is(study: Study) -> None:
    subject = subject_of(CASE.task)
    predictor, trials = Predictor(subject, catalogue(subject.rods)), prepare(study, subject)
    nominal = predictor.catalogue.nominal(subject)
    thinner = at(predictor.catalogue, nominal, "mask_erosion", [0.0015])
    whole, eroded = predictor(trials, [nominal, thinner]).after
    moved = np.linalg.norm((whole - trials.clouds)[:, :, :2], axis=2)
    assert moved.max() > 0.02
    for k in range(len(trials)):
        apart = (whole[k] - eroded[k])[:, :2]
        assert np.abs(apart).max() < 0.004
        assert np.linalg.norm(apart[moved[k] > 0.01].mean(0)) < 3e-4


def test_every_order_has_a_name_of_its_own_and_a_size_that_its_parameters_allow() -> None:
    asked = list(orders(6))
    assert len({order.key for order in asked}) == len(asked)
    for order in asked:
        if order.effect:
            specs = effect_of(order.effect).parameters
            assert all(spec.low <= value <= spec.high for spec, value in zip(specs, order.values(), strict=True)), order


def test_only_the_truth_alone_counts_as_named_and_a_name_without_a_cause_as_wrong() -> None:
    def line(effect: str, kind: str, causes: tuple[str, ...], probability: float):
        first = causes[0] if causes else "backlash"
        said = Verdict(
            kind=kind,  # pyright: ignore[reportArgumentType] - all kinds are tried below
            causes=causes,
            probabilities={first: probability, "draught": 0.01},
            sizes={},
        )
        return {"key": "", **described(effect, np.zeros(0), said)}

    assert outcome_of(line("backlash", "named", ("backlash",), 0.95)) == "named"
    assert outcome_of(line("backlash", "set", ("backlash",), 0.6)) == "first"
    assert outcome_of(line("tcp_offset", "named", ("backlash",), 0.95)) == "wrong"
    assert outcome_of(line("", "named", ("backlash",), 0.95)) == "wrong"
    assert outcome_of(line("tcp_offset", "none", (), 0.1)) == "silent"
    assert summary([line("", "none", (), 0.1)], "").row_count == 1
