"""Cameras found from rendered views of a board, in both set-ups, and refused where the views cannot tell."""

from dataclasses import replace
from datetime import date

import numpy as np
import pytest

from app.core.errors import PerceptionError
from app.core.geometry.hand_eye import HandEye
from app.perception.calibration.drift import drift
from app.perception.calibration.se3 import exp, transform
from app.perception.calibration.solve import CalibrationView, Solved, solve
from app.perception.calibration.spread import spread_of
from bench.boards import BOARD, LENS, Camera, Errors, cell, off, seen

DAY = date(2026, 11, 23)
ARM = Errors(joints_m=0.0002, joints_deg=0.02)
"""About the repeatability of an arm of this size."""


def solved(views: list[CalibrationView], setup="fixed") -> Solved:
    return solve(views, setup, LENS, BOARD, serial="camera0", calibrated_at=DAY)


@pytest.mark.parametrize("setup", ["fixed", "wrist"])
@pytest.mark.parametrize("outliers", [0.0, 0.2])
def test_25_rendered_views_place_the_camera_to_a_millimetre_and_a_tenth_of_a_degree(setup, outliers):
    for seed in range(2):
        truth = cell(seed, 25, setup)
        found = solved(seen(truth, seed, replace(ARM, outliers=outliers), Camera()), setup)
        wrong_mm, wrong_deg = off(found.found.pose, truth)
        assert wrong_mm < 1.0
        assert wrong_deg < 0.1
        assert found.found.outliers == round(25 * outliers)
        assert found.found.error_px < 1.5


def test_outliers_are_named_and_by_how_much_they_are_wrong():
    truth = cell(5, 15)
    views = seen(truth, 5, ARM)
    for index in (3, 11):
        nudge = transform(exp(np.radians([0.0, 5.0, 0.0])), np.array([0.0, 0.03, 0.0]))
        views[index] = replace(views[index], T_world_gripper=views[index].T_world_gripper @ nudge)
    found = solved(views)
    assert found.outliers == (3, 11)
    np.testing.assert_allclose(found.view_error_m[[3, 11]], 0.03, atol=0.003)
    np.testing.assert_allclose(found.view_error_deg[[3, 11]], 5.0, atol=0.6)
    assert np.delete(found.view_error_deg, [3, 11]).max() < 0.3


@pytest.mark.parametrize("setup", ["fixed", "wrist"])
def test_the_errors_are_as_large_as_the_standard_deviations_say(setup):
    turns, shifts = list[np.ndarray](), list[np.ndarray]()
    for seed in range(12):
        truth = cell(seed, 12, setup)
        found = solved(seen(truth, seed, Errors(joints_m=0.0006, joints_deg=0.06), noise_px=0.2), setup).found
        shifts.append((found.pose[:3, 3] - truth.X[:3, 3]) / found.deviation_m)
        wrong = found.pose[:3, :3] @ truth.X[:3, :3].T
        vee = np.array([wrong[2, 1] - wrong[1, 2], wrong[0, 2] - wrong[2, 0], wrong[1, 0] - wrong[0, 1]]) / 2
        turns.append(np.degrees(vee) / found.deviation_deg)
    for normal in (np.concatenate(shifts), np.concatenate(turns)):
        # 36 numbers, those of a session correlated: their mean square is within 0.4 and 2 nearly always.
        assert 0.4 < np.mean(normal**2) < 2.0


def held(truth, poses):
    """The board as it is seen when the gripper goes to these poses."""
    return replace(truth, C=np.linalg.inv(truth.X) @ poses @ truth.Y)


def test_views_that_cannot_tell_are_refused_with_what_to_do():
    truth = cell(6, 12)
    first, rng = truth.grippers[0], np.random.default_rng(0)
    shifted = np.array([transform(first[:3, :3], first[:3, 3] + rng.uniform(-0.04, 0.04, 3)) for _ in range(12)])
    about_one = shifted.copy()
    for pose in about_one:
        pose[:3, :3] = exp(np.array([0.0, 0.0, rng.uniform(-0.3, 0.3)])) @ first[:3, :3]
    for poses, said in ((shifted, "position alone"), (about_one, "about one axis"), (truth.grippers[:4], "4 views")):
        with pytest.raises(PerceptionError, match=said):
            solved(seen(held(truth, poses), 6, ARM))


def test_views_of_which_most_are_wrong_are_refused():
    truth = cell(7, 12)
    with pytest.raises(PerceptionError, match="check that the board is fast"):
        solved(seen(truth, 7, Errors(outliers=0.75)))


def test_a_pose_that_is_no_number_is_refused():
    views = seen(cell(8, 6), 8, ARM)
    views[2] = replace(views[2], T_world_gripper=np.full((4, 4), np.nan))
    with pytest.raises(PerceptionError, match="not finite"):
        solved(views)


def test_the_spread_counts_turns_about_each_axis():
    turns = np.radians([[10, 0, 0], [-10, 0, 0], [0, 5, 0], [0, -5, 0]])
    spread = spread_of(transform(exp(turns), np.zeros((4, 3))))
    np.testing.assert_allclose(spread.turns_deg, [10 / np.sqrt(2), 5 / np.sqrt(2), 0.0], atol=0.05)
    assert spread.shifts_m == (0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def calibrated() -> tuple[HandEye, list[CalibrationView]]:
    views = seen(cell(9, 20), 9, ARM)
    return solved(views[:15]).found, views[15:]


def test_a_camera_that_stands_as_it_was_has_not_drifted(calibrated):
    found, fresh = calibrated
    for view in fresh:
        told = drift(found, view)
        assert not told.beyond
        assert "holds" in str(told)


def test_a_camera_that_was_knocked_has(calibrated):
    found, fresh = calibrated
    for moved_m, turned_deg in ((0.006, 0.0), (0.0, 1.0)):
        knocked = found.pose @ transform(exp(np.radians([turned_deg, 0.0, 0.0])), np.array([moved_m, 0.0, 0.0]))
        told = drift(replace(found, pose=knocked), fresh[0])
        assert told.beyond
        assert "calibrate again" in str(told)
        assert told.moved_m > moved_m - 0.002
        assert told.turned_deg > turned_deg - 0.2
