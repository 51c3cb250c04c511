"""Calibrating a camera in the console: what it sees of the board, and what the views that were taken say."""

from dataclasses import dataclass, field
from typing import final

import numpy as np
from jaxtyping import Float32, Float64

from app.core.hand_eye import Spread, Three
from app.core.messages import Message
from app.core.types import Transform


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class BoardSeen(Message):
    """The board in a camera's newest frame, whose id is the cause: `corners` [pixel], none where it is not seen.

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
    """A view that was taken: how the gripper was tilted from the first one, and what it misses the result by.

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
    """Where the camera is by the views, how sure, and how far that is from what is in use."""

    pose: Transform
    deviation_m: Three
    deviation_deg: Three
    error_px: float
    moved_m: float
    turned_deg: float


@final
@dataclass(frozen=True, kw_only=True)
class Checked:
    """What one fresh view says of the calibration that was kept: where the board is seen and should be."""

    moved_m: float
    turned_deg: float
    beyond: bool


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Placing(Message):
    """How the calibration of a camera stands; nobody is at it any more where it is not `under_way`.

    `placed`, `spread`, `checked`: one, or none yet. `next_pose (0 or 1, 7)`: where the gripper should go, as a tool
    pose, which makes the worst standard deviation of the camera's place `promised_m`. `said`: what is missing, or what
    was done. `kept_at`: the day of the calibration that was kept for this camera, or of a later check that it stood;
    empty where there is none.
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
