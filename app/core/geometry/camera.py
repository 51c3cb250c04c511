"""Calibrated camera: pose, intrinsics, and the age of its calibration."""

from dataclasses import dataclass
from datetime import date
from typing import Final, final

from app.core.types import Intrinsics, Transform

STALE_DAYS: Final = 30
"""Age in days beyond which a calibration should be checked."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class CameraModel:
    """A calibrated RGB-D camera whose depth is aligned to its colour image.

    The optical frame follows OpenCV: x right, y down, z forward. `calibrated_at`: the day, as 2026-11-23; empty where
    it was not recorded. `checked_at`: the day of the last check that confirmed its pose; `doubt`: the finding of a
    later check that contradicts the calibration; each empty where there is none.
    """

    name: str
    width: int
    height: int
    K: Intrinsics
    T_world_camera: Transform
    depth_unit_m: float
    calibrated_at: str = ""
    checked_at: str = ""
    doubt: str = ""

    def age_days(self, today: date) -> int | None:
        """Days since it was calibrated or last passed a check; None where that day is unknown or in the future."""
        try:
            days = (today - date.fromisoformat(max(self.calibrated_at[:10], self.checked_at[:10]))).days
        except ValueError:
            return None
        return days if days >= 0 else None

    def stale(self, today: date) -> bool:
        """True where its calibration should be checked, or has failed a check."""
        days = self.age_days(today)
        return bool(self.doubt) or days is None or days > STALE_DAYS
