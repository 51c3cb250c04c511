"""Drift check of a camera's calibration, by one fresh view of the same board, held as it was then."""

from dataclasses import dataclass
from typing import final

import numpy as np

from app.core.geometry.hand_eye import HandEye
from app.perception.calibration.chain import Ends, outer, residuals
from app.perception.calibration.se3 import angle, inverse, transform_points
from app.perception.calibration.solve import CalibrationView, ends_of

BOUND_M, BOUND_DEG = 0.003, 0.4
"""Bounds beyond which a camera counts as moved. One view of a board errs by 1 mm and 0.1 degree; 4 mm apart, two
cameras see one rope as two (`ui/view/views.py`)."""


@final
@dataclass(frozen=True, kw_only=True)
class Drift:
    """Deviation of the observed board from its prediction: `moved_m` of its middle, `turned_deg`, and `error_px`."""

    moved_m: float
    turned_deg: float
    error_px: float

    @property
    def beyond(self) -> bool:
        """True where the deviation exceeds the error of one view."""
        return self.moved_m > BOUND_M or self.turned_deg > BOUND_DEG

    def __str__(self) -> str:
        """Sentence on the deviation and its consequence."""
        told = (
            f"The board is seen {1e3 * self.moved_m:.1f} mm and {self.turned_deg:.2f} degrees from where it should be"
        )
        if self.beyond:
            return f"{told}: camera or board has moved since; calibrate again."
        return f"{told}: the calibration holds."


def drift(found: HandEye, view: CalibrationView) -> Drift:
    """Drift from one fresh view. A board that was taken off and put back elsewhere looks like a camera that moved."""
    H, ends = outer(view.T_world_gripper, found.setup), ends_of(found)
    points, seen = view.sight.points(found.board), ends.X @ view.sight.T_camera_board
    expected = H @ ends.Y
    middle = points.mean(axis=0, keepdims=True)
    off = residuals(Ends(X=ends.X, Y=ends.Y), H, points, view.sight.pixels, found.lens)
    return Drift(
        moved_m=float(np.linalg.norm(transform_points(seen, middle) - transform_points(expected, middle))),
        turned_deg=float(np.degrees(angle((inverse(expected) @ seen)[:3, :3]))),
        error_px=float(np.sqrt(2 * np.mean(off**2))),
    )
