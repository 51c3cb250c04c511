"""Where a camera stands, and how its pixels are rays."""

from dataclasses import dataclass
from typing import final

from app.core.types import Intrinsics, Transform


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
