"""Assessment of a calibration after each view: pose diversity, result or missing condition, and the next best view."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import final

import numpy as np
from jaxtyping import Float64

from app.config import Workspace
from app.core.errors import PerceptionError
from app.core.geometry.charuco import Charuco
from app.core.geometry.hand_eye import Spread
from app.core.geometry.lens import Lens
from app.core.types import Transform
from app.perception.calibration.next_pose import HandEyeSetup, NextPose, about, next_pose
from app.perception.calibration.se3 import log
from app.perception.calibration.solve import CalibrationView, Solved, ends_of, solve
from app.perception.calibration.spread import spread_of


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Target:
    """A fixed camera under calibration, with an approximate `pose`, its intrinsics, and the board."""

    serial: str
    pose: Transform
    lens: Lens
    board: Charuco


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Assessment:
    """Assessment: `solved`, or the condition that it `lacks`, in words.

    `tilts_deg (V, 2)`: tilts of the gripper from the first view.
    """

    spread: Spread
    tilts_deg: Float64[np.ndarray, "V 2"]
    solved: Solved | None
    lacks: str
    next_pose: NextPose | None


def assess(views: Sequence[CalibrationView], target: Target, workspace: Workspace, today: date) -> Assessment:
    """Assess the calibration from at least one view."""
    solved, lacks = _solve(views, target, today)
    eye = about(views, target.pose, target.lens, target.board, "fixed")
    if solved is not None:
        eye = HandEyeSetup(lens=target.lens, board=target.board, setup="fixed", ends=ends_of(solved.found))
    poses = np.array([view.T_world_gripper for view in views])
    turns = log(poses[:, :3, :3] @ poses[0, :3, :3].T)
    return Assessment(
        spread=spread_of(poses),
        tilts_deg=np.degrees(turns[:, :2]),
        solved=solved,
        lacks=lacks,
        next_pose=next_pose(eye, views, workspace, np.random.default_rng(len(views))),
    )


def _solve(views: Sequence[CalibrationView], target: Target, today: date) -> tuple[Solved | None, str]:
    try:
        return solve(views, "fixed", target.lens, target.board, serial=target.serial, calibrated_at=today), ""
    except PerceptionError as error:
        return None, str(error)
