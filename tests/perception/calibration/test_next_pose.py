"""The next pose of a calibration: possible, in sight of the camera, and as informative as it promises."""

import numpy as np
import pytest

from app.config import Workspace
from app.perception.calibration.chain import Ends, outer
from app.perception.calibration.next_pose import HandEyeSetup, NextPose, about, next_pose
from app.perception.calibration.se3 import exp, inverse, transform, transform_points
from app.perception.calibration.solve import CalibrationView
from bench.boards import BOARD, LENS, Cell, Errors, cell, exact, seen

WIDE = Workspace(low=(-2.0, -2.0, 0.0), high=(2.0, 2.0, 2.0))


def standing(setup="fixed") -> tuple[Cell, list[CalibrationView]]:
    truth = cell(0, 1, setup)
    return truth, seen(truth, 0, Errors())


@pytest.mark.parametrize("setup", ["fixed", "wrist"])
def test_the_board_is_whole_in_the_image_there_and_the_gripper_in_the_workspace(setup):
    truth, views = standing(setup)
    eye = about(views, truth.X, LENS, BOARD, setup)
    for seed in range(5):
        best = found(eye, views, seed)
        assert WIDE.contains(best.T_world_gripper[:3, 3])
        H = outer(best.T_world_gripper, setup)
        pixels = LENS.project(transform_points(inverse(truth.X) @ H @ truth.Y, BOARD.outline()))
        assert np.all((pixels > 0) & (pixels < [LENS.width, LENS.height]))
        assert best.promised_m < best.deviation_m


def found(eye: HandEyeSetup, views: list[CalibrationView], seed: int) -> NextPose:
    best = next_pose(eye, views, WIDE, np.random.default_rng(seed))
    assert best is not None
    return best


def test_going_where_it_says_makes_the_camera_surer_than_going_anywhere():
    truth, views = standing()
    eye = about(views, truth.X, LENS, BOARD, "fixed")
    guided, aimless = list(views), list(views)
    rng = np.random.default_rng(1)
    for step in range(5):
        guided.append(taken(truth, found(eye, guided, step).T_world_gripper))
        nudge = transform(exp(rng.uniform(-0.1, 0.1, 3)), rng.uniform(-0.03, 0.03, 3))
        aimless.append(taken(truth, truth.grippers[0] @ nudge))
    assert found(eye, guided, 9).deviation_m < 0.5 * found(eye, aimless, 9).deviation_m


def taken(truth: Cell, gripper: np.ndarray) -> CalibrationView:
    C = inverse(truth.X) @ gripper @ truth.Y
    return CalibrationView(sight=exact(C, 0.1, np.random.default_rng(0)), T_world_gripper=gripper)


def test_where_nothing_is_possible_nothing_is_said():
    truth, views = standing()
    eye = HandEyeSetup(lens=LENS, board=BOARD, setup="fixed", ends=Ends(X=truth.X, Y=truth.Y))
    nowhere = Workspace(low=(5.0, 5.0, 5.0), high=(5.1, 5.1, 5.1))
    assert next_pose(eye, views, nowhere, np.random.default_rng(0)) is None
