"""Messages of camera calibration in the console: the board as seen, the views taken, and the result so far."""

from dataclasses import dataclass, field
from typing import final

import numpy as np
from jaxtyping import Float32, Float64

from app.core.geometry.hand_eye import Spread, Three
from app.core.messages import Message
from app.core.types import Transform


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class BoardSeen(Message):
    """The board in a camera's newest frame, whose id is the cause: `corners` (M, 2) [pixel], none where it is not seen.

    `why` it is not seen, in words; `distance_m` of its middle from the camera, `error_px` of reprojection.
    """

    camera: str
    corners: Float32[np.ndarray, "M 2"]
    error_px: float
    distance_m: float
    why: str = ""


@final
@dataclass(frozen=True, kw_only=True)
class TakenView:
    """A view that was taken: the gripper's tilt from the first one, and its residuals.

    The errors are NaN where there is no result yet.
    """

    tilt_deg: tuple[float, float]
    error_px: float
    error_m: float
    error_deg: float
    outlier: bool


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """Camera pose from the views, its uncertainty, and its distance from the calibration in use."""

    pose: Transform
    deviation_m: Three
    deviation_deg: Three
    error_px: float
    moved_m: float
    turned_deg: float


@final
@dataclass(frozen=True, kw_only=True)
class Checked:
    """Test of the stored calibration on one fresh view: distance of the observed board from the predicted one."""

    moved_m: float
    turned_deg: float
    beyond: bool


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Placing(Message):
    """State of a camera's calibration; ended where it is not `under_way`.

    `placed`, `spread`, `checked`: one, or none yet. `next_pose (0 or 1, 7)`: the next best view, as a tool pose of the
    gripper, which lowers the largest standard deviation of the camera's position to `promised_m`. `said`: the missing
    step, or the last one done. `kept_at`: the day of this camera's stored calibration, or of a later check that
    confirmed it; empty where there is none.
    """

    camera: str
    under_way: bool
    views: tuple[TakenView, ...] = ()
    spread: tuple[Spread, ...] = ()
    placed: tuple[Placed, ...] = ()
    checked: tuple[Checked, ...] = ()
    next_pose: Float64[np.ndarray, "Q 7"] = field(default_factory=lambda: np.zeros((0, 7)))
    promised_m: float = float("nan")
    said: str = ""
    kept_at: str = ""
