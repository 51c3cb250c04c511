"""The chain from board to pixels: its slopes, and both set-ups as one equation."""

import numpy as np
import pytest

from app.perception.calibration.chain import JOINTS_M, JOINTS_RAD, PIXEL_PX, Ends, outer, residuals, slopes, whiten
from app.perception.calibration.se3 import exp, inverse, transform
from app.perception.calibration.start import of_all, start
from bench.boards import BOARD, LENS, cell, off

STEP = 1e-6


@pytest.mark.parametrize("setup", ["fixed", "wrist"])
def test_the_slopes_are_finite_differences(setup):
    truth = cell(0, 1, setup)
    H, points = outer(truth.grippers, setup)[0], BOARD.corners()
    ends, pixels = Ends(X=truth.X, Y=truth.Y), np.zeros((len(points), 2))
    by_ends, by_gripper = slopes(ends, H, points, LENS, setup)
    for column, by in enumerate(np.eye(12) * STEP):
        there, back = (residuals(ends.shift(sign * by), H, points, pixels, LENS) for sign in (1, -1))
        np.testing.assert_allclose(by_ends[:, column], (there - back) / (2 * STEP), rtol=1e-4, atol=1e-2)
    for column, by in enumerate(np.eye(6) * STEP):
        there, back = (residuals(ends, nudged(H, sign * by, setup), points, pixels, LENS) for sign in (1, -1))
        np.testing.assert_allclose(by_gripper[:, column], (there - back) / (2 * STEP), rtol=1e-4, atol=1e-2)


def nudged(H, by, setup):
    """The gripper turned about its own origin, which is the inner frame's of a fixed camera, and shifted."""
    pivot = H[:3, 3] if setup == "fixed" else np.zeros(3)
    turn = transform(exp(by[:3]), pivot - exp(by[:3]) @ pivot + by[3:])
    return turn @ H


def test_whitening_is_the_inverse_of_the_covariance():
    truth = cell(1, 1)
    _, by_gripper = slopes(Ends(X=truth.X, Y=truth.Y), truth.grippers[0], BOARD.corners(), LENS, "fixed")
    joints = np.diag([JOINTS_RAD**2] * 3 + [JOINTS_M**2] * 3)
    S = PIXEL_PX**2 * np.eye(len(by_gripper)) + by_gripper @ joints @ by_gripper.T
    np.testing.assert_allclose(whiten(by_gripper, S), np.eye(len(S)), atol=1e-8)


@pytest.mark.parametrize("setup", ["fixed", "wrist"])
def test_without_noise_the_closed_form_is_exact(setup):
    truth = cell(2, 6, setup)
    ends = of_all(outer(truth.grippers, setup), truth.C, np.ones(6, bool))
    np.testing.assert_allclose(ends.X, truth.X, atol=1e-9)
    np.testing.assert_allclose(ends.Y, truth.Y, atol=1e-9)


def test_the_start_withstands_two_wrong_views_of_five_and_more():
    truth = cell(3, 12)
    H = truth.grippers.copy()
    H[[1, 5, 6, 9]] = H[[1, 5, 6, 9]] @ transform(exp(np.array([0.3, -0.2, 0.1])), np.array([0.05, 0.02, -0.03]))
    ends = start(H, truth.C, np.random.default_rng(0))
    assert off(ends.X, truth) < (0.01, 0.001)


def test_a_transform_and_its_inverse_are_nothing():
    truth = cell(4, 5)
    np.testing.assert_allclose(inverse(truth.C) @ truth.C, np.tile(np.eye(4), (5, 1, 1)), atol=1e-12)
