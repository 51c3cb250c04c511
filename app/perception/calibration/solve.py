"""Hand-eye solution from views of a board: initial estimate, refinement, uncertainty, and rejection of poor data."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import final

import numpy as np
from jaxtyping import Float64

from app.core.errors import PerceptionError
from app.core.geometry.charuco import Charuco
from app.core.geometry.hand_eye import HandEye, Setup
from app.core.geometry.lens import Lens
from app.core.types import Transform
from app.perception.calibration.chain import Ends, outer
from app.perception.calibration.refine import Corners, Refined, refine
from app.perception.calibration.sight import BoardDetection
from app.perception.calibration.spread import FEWEST_VIEWS, lack, spread_of
from app.perception.calibration.start import start

_SEED = 0
_UNSURE_M, _UNSURE_DEG = 0.005, 0.5
"""Standard deviations above which a camera is unusable: an object seen by two would appear twice."""
_MOST_OUTLIERS = 0.4
"""Largest share of outliers: where more views are wrong, the others may be wrong in the same way."""
_CONTRARY_M, _CONTRARY_DEG = 0.008, 1.0
"""Median residual of the chain above which the views contradict each other; it is a tenth of this in good data."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class CalibrationView:
    """The board in one image, and the pose `T_world_gripper` that the arm reported at rest then."""

    sight: BoardDetection
    T_world_gripper: Transform


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Solved:
    """The calibrated camera, with inlier flag and residuals of each view, in order."""

    found: HandEye
    refined: Refined

    @property
    def outliers(self) -> tuple[int, ...]:
        """Indices of the outlier views."""
        return tuple(int(index) for index in np.flatnonzero(~self.refined.kept))

    @property
    def view_error_m(self) -> Float64[np.ndarray, " V"]:
        """Translation error of the gripper's pose in each view [m]."""
        return np.linalg.norm(self.refined.shift_m, axis=1)

    @property
    def view_error_deg(self) -> Float64[np.ndarray, " V"]:
        """Rotation error of the gripper's pose in each view [degree]."""
        return np.degrees(np.linalg.norm(self.refined.turn_rad, axis=1))


def solve(
    views: Sequence[CalibrationView], setup: Setup, lens: Lens, board: Charuco, *, serial: str, calibrated_at: date
) -> Solved:
    """The camera of `serial`. Raises PerceptionError, which names the missing condition, for insufficient views."""
    poses = np.array([view.T_world_gripper for view in views]).reshape(-1, 4, 4)
    _check(poses)
    H, C = outer(poses, setup), np.array([view.sight.T_camera_board for view in views])
    corners = corners_of(views, board, setup)
    refined = refine(start(H, C, np.random.default_rng(_SEED)), corners, lens, setup)
    kept = refined.kept
    _check_agreeing(refined)
    _check(poses[kept], counted="without the outliers")
    deviation = np.sqrt(np.diag(refined.covariance))[:6]
    _check_sure(deviation)
    found = HandEye(
        serial=serial,
        setup=setup,
        pose=refined.ends.X,
        board_pose=refined.ends.Y,
        lens=lens,
        board=board,
        calibrated_at=calibrated_at,
        views=int(kept.sum()),
        outliers=int((~kept).sum()),
        error_px=_rms(refined.error_px[kept]),
        error_m=_rms(np.linalg.norm(refined.shift_m[kept], axis=1)),
        error_deg=float(np.degrees(_rms(np.linalg.norm(refined.turn_rad[kept], axis=1)))),
        deviation_m=_three(deviation[3:]),
        deviation_deg=_three(np.degrees(deviation[:3])),
        spread=spread_of(poses[kept]),
    )
    return Solved(found=found, refined=refined)


def corners_of(views: Sequence[CalibrationView], board: Charuco, setup: Setup) -> list[Corners]:
    """Data of each view for the chain."""
    return [
        Corners(H=outer(view.T_world_gripper, setup), points=view.sight.points(board), pixels=view.sight.pixels)
        for view in views
    ]


def ends_of(found: HandEye) -> Ends:
    """The two ends of the chain of a calibration."""
    return Ends(X=found.pose, Y=found.board_pose)


def _check(poses: Float64[np.ndarray, "V 4 4"], counted: str = "") -> None:
    if not np.all(np.isfinite(poses)):
        raise PerceptionError("A pose of the gripper is not finite; take the view again.")
    missing = lack(spread_of(poses), len(poses))
    if missing:
        raise PerceptionError(f"{missing} ({counted})" if counted else missing)


def _check_agreeing(refined: Refined) -> None:
    """Raises PerceptionError where too many views are outliers, or where all are wrong, so that none stands out."""
    out, turn_rad = ~refined.kept, float(np.median(np.linalg.norm(refined.turn_rad, axis=1)))
    shift_m = float(np.median(np.linalg.norm(refined.shift_m, axis=1)))
    if shift_m > _CONTRARY_M or np.degrees(turn_rad) > _CONTRARY_DEG:
        said = f"Half of the views miss the chain by {1e3 * shift_m:.0f} mm and {np.degrees(turn_rad):.1f} degrees"
    elif out.mean() > _MOST_OUTLIERS or (~out).sum() < FEWEST_VIEWS:
        said = f"{out.sum()} of {len(out)} views contradict the others"
    else:
        return
    raise PerceptionError(
        f"{said}; check that the board is fast, that the arm was at rest, that its tool pose is the one that is meant, "
        "and take new views."
    )


def _check_sure(deviation: Float64[np.ndarray, "6"]) -> None:
    turn_deg, shift_m = float(np.degrees(deviation[:3].max())), float(deviation[3:].max())
    if turn_deg > _UNSURE_DEG or shift_m > _UNSURE_M:
        raise PerceptionError(
            f"These views leave the camera open by {1e3 * shift_m:.1f} mm and {turn_deg:.2f} degrees (standard "
            "deviations); tilt the gripper more, about both axes, and bring the board nearer."
        )


def _rms(values: Float64[np.ndarray, " V"]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _three(values: Float64[np.ndarray, "3"]) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
