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
    nobody noted it.
    """

    name: str
    width: int
    height: int
    K: Intrinsics
    T_world_camera: Transform
    depth_unit_m: float
    calibrated_at: str = ""

    def age_days(self, today: date) -> int | None:
        """How long ago it was calibrated; None where nobody noted the day, or that is none or is to come."""
        try:
            days = (today - date.fromisoformat(self.calibrated_at[:10])).days
        except ValueError:
            return None
        return days if days >= 0 else None

    def stale(self, today: date) -> bool:
        """Whether its calibration wants to be checked."""
        days = self.age_days(today)
        return days is None or days > STALE_DAYS
