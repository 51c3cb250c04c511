"""A carried cloth: what is compared of it, the causes it is asked about, and the hold as the simulator takes it."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.geometry.track import Track
from app.discovery.checks.data_consistency import contradictions
from app.discovery.dataset.held_part import with_held_parts
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.residuals.displacement_field import SHEET_MODES, Basis, register
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.simulation_batch import prepare
from app.jobs.discovery_subject import subject_of
from app.policy.random_carries import carry_design, random_carry
from app.sim.model.params import index
from app.tasks import load

TASK = load("cloth_hang")
SUBJECT = subject_of(TASK)
FINGERS = SUBJECT.fingers
AT = np.array([0.55, -0.15, 0.25])
HIDDEN_M = 0.02
"""Part of the cloth below the tips of the fingers that no camera sees."""


def hanging(seed: int = 0) -> np.ndarray:
    """A cloth that hangs from the gripper in a slight curve, without what the fingers hide."""
    rng = np.random.default_rng(seed)
    u, z = rng.uniform(-0.06, 0.06, SUBJECT.particle_count), rng.uniform(HIDDEN_M, 0.22, SUBJECT.particle_count)
    return (AT + np.stack([u, 0.02 * np.cos(20 * u), -z], axis=1)).astype(np.float32)


def carry(seed: int, start_s: float) -> Track:
    start = np.array([*AT, 0.0, 1.0, 0.0, 0.0, 0.004])
    return random_carry(np.random.default_rng(seed), start, carry_design(1, 1), start_s=start_s, closed_m=0.004)


def study_of(x: np.ndarray, count: int) -> Study:
    def push(k: int) -> Push:
        track = carry(k, 8.0 * k)
        before, after = (ProjectionView(time_s=at, points=x) for at in (track.times_s[0] - 0.1, track.end_s + 1.0))
        return Push(episode=k, before=before, during=(), after=after, command=track, measured=track)

    return Study(task=TASK.name, pushes=tuple(push(k) for k in range(count)))


def test_causes_of_other_objects_are_not_asked_about_and_those_of_a_cloth_are() -> None:
    causes = {cause.name for cause in SUBJECT.catalogue().causes}
    assert {"draught", "table_tilt", "viscous_film", "command_delay", "tcp_offset", "depth_bias"} <= causes
    assert not causes & {"mass_heterogeneity", "rolling_resistance", "adhesion", "mask_erosion", "tool_compliance"}
    assert SUBJECT.tool_coordinates == 8


@pytest.mark.parametrize("shift", [(0.02, -0.01, 0.015), (-0.15, 0.1, 0.05)])
def test_a_shift_in_space_is_measured_as_one_however_far(shift: tuple[float, float, float]) -> None:
    predicted = hanging()
    observed = predicted[np.random.default_rng(1).permutation(len(predicted))] + np.array(shift, np.float32)
    basis = Basis.over(predicted)
    found = register(predicted, observed, basis)
    assert basis.vectors.shape == (len(predicted), SHEET_MODES, 3)
    assert found[:: SHEET_MODES // 3] == pytest.approx(shift, abs=1e-3)
    assert np.abs(basis.field(found) - shift).max() < 3e-3


def test_a_stretch_across_a_flat_cloth_is_not_made_up() -> None:
    flat = hanging().astype(np.float64)
    flat[:, 2] = 0.002
    basis = Basis.over(flat.astype(np.float32))
    lifted = np.zeros((len(flat), 3))
    lifted[:, 2] = np.random.default_rng(0).normal(0.005, 1e-3, len(flat))
    found = basis.project(lifted).reshape(3, 4)
    assert found[2, 0] == pytest.approx(0.005, abs=5e-4)
    assert np.abs(found[:, 3]).max() < 1e-4


def test_a_stretch_along_the_cloth_is_projected_and_registered_alike() -> None:
    predicted = hanging()
    away = np.zeros((len(predicted), 3))
    away[:, 2] = 0.08 * (predicted[:, 2] - predicted[:, 2].mean())
    basis = Basis.over(predicted)
    projected, registered = basis.project(away), register(predicted, predicted + away.astype(np.float32), basis)
    assert projected.reshape(3, 4)[2, 3] == pytest.approx(0.008, rel=0.1)
    assert registered == pytest.approx(projected, abs=1.5e-3)


def test_the_part_between_the_fingers_is_added_where_they_are_closed_and_nowhere_else() -> None:
    assert FINGERS is not None
    x, study = hanging(), study_of(hanging(), 1)
    (whole,) = with_held_parts(study, FINGERS).pushes
    assert whole.before.points.shape == x.shape
    assert np.linalg.norm(x - AT, axis=1).min() > 0.9 * HIDDEN_M
    away = whole.before.points - AT
    assert np.linalg.norm(away, axis=1).min() < 1e-6
    assert np.sum(np.abs(away[:, 2]) < 1e-6) == 5
    opened = study.pushes[0].command.poses.copy()
    opened[:, 7] = FINGERS.opening_m
    track = Track(times_s=study.pushes[0].command.times_s, poses=opened)
    before = study.pushes[0].before
    loose = Push(episode=0, before=before, during=(), after=before, command=track, measured=track)
    (same,) = with_held_parts(Study(task=TASK.name, pushes=(loose,)), FINGERS).pushes
    assert np.array_equal(same.before.points, x)


@pytest.mark.parametrize("above_m", [0.05, 0.1, 0.3])
def test_nothing_is_added_between_a_cloth_and_fingers_far_above_it(above_m: float) -> None:
    assert FINGERS is not None
    flat = hanging() * np.array([1.0, 1.0, 0.0], np.float32)
    lifted = moved(study_of(flat, 1), above_m - AT[2])
    (same,) = with_held_parts(lifted, FINGERS).pushes
    assert np.array_equal(same.before.points, flat)


def test_a_cloth_that_the_gripper_does_not_hold_to_the_end_is_no_carry() -> None:
    study = study_of(hanging(), 12)
    assert not [each for each in contradictions(study, SUBJECT) if "gripper" in each.text]
    for wrong in (opened(study, 0, None), opened(study, -1, None), moved(study, 0.1)):
        (fatal,) = [each for each in contradictions(wrong, SUBJECT) if each.fatal]
        assert "open, or farther than 40 mm from the object, in 12 of 12 carries" in fatal.text
    closes = opened(study, 0, 2)
    assert not [each for each in contradictions(closes, SUBJECT) if "gripper" in each.text]


def opened(study: Study, begin: int, end: int | None) -> Study:
    """The study with an open gripper in these samples of each carry."""
    assert FINGERS is not None
    pushes = list[Push]()
    for push in study.pushes:
        poses = push.command.poses.copy()
        poses[begin:end, 7] = FINGERS.opening_m
        track = replace(push.command, poses=poses)
        pushes.append(replace(push, command=track, measured=track))
    return replace(study, pushes=tuple(pushes))


def moved(study: Study, up_m: float) -> Study:
    """The study with the gripper so much higher."""
    pushes = list[Push]()
    for push in study.pushes:
        track = replace(push.command, poses=push.command.poses + up_m * np.eye(8)[2])
        pushes.append(replace(push, command=track, measured=track))
    return replace(study, pushes=tuple(pushes))


def test_a_cloth_is_simulated_in_the_hand_to_where_it_is_carried_and_open_fingers_leave_it() -> None:
    study = study_of(hanging(), 2)
    predictor = Predictor(SUBJECT, SUBJECT.catalogue())
    trials, about = prepare(study, SUBJECT), predictor.catalogue.nominal(SUBJECT)
    lighter = about.copy()
    lighter[index("draught_x")] = 0.2
    ends = predictor(trials, [about, lighter]).after
    for push, end, blown in zip(study.pushes, *ends, strict=True):
        there = push.command.positions[-1]
        assert np.linalg.norm(end - there, axis=1).min() < 0.01
        assert end[:, 2].max() < there[2] + 0.07
        assert blown[:, 0].mean() - end[:, 0].mean() > 0.002
