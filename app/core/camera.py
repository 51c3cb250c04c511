"""Where a camera stands, and how its pixels are rays."""

from dataclasses import dataclass
from datetime import date
from typing import Final, final

from app.core.types import Intrinsics, Transform

STALE_DAYS: Final = 30
"""A calibration that is older wants to be checked."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class CameraModel:
    """A calibrated RGB-D camera whose depth is aligned to its colour image.

    The optical frame follows OpenCV: x right, y down, z forward. `calibrated_at`: the day, as 2026-11-23; empty where
    nobody noted it. `checked_at`: the day of the last check in which it stood where it was calibrated; `doubt`: what a
    check has found since that does not fit; each empty where there is none.
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
        """How long ago it was calibrated or last stood a check; None where that day is unknown, none, or to come."""
        try:
            days = (today - date.fromisoformat(max(self.calibrated_at[:10], self.checked_at[:10]))).days
        except ValueError:
            return None
        return days if days >= 0 else None

    def stale(self, today: date) -> bool:
        """Whether its calibration wants to be checked, or has not stood a check."""
        days = self.age_days(today)
        return bool(self.doubt) or days is None or days > STALE_DAYS
