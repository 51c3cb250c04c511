"""Hand-eye calibration of a camera: its result, its uncertainty, and its last checks."""

from dataclasses import dataclass
from datetime import date
from typing import Literal, TypeAlias, final

from app.core.errors import UsageError
from app.core.geometry.camera import CameraModel
from app.core.geometry.charuco import Charuco
from app.core.geometry.lens import Lens
from app.core.types import Transform

Setup: TypeAlias = Literal["fixed", "wrist"]
"""Eye-to-hand (fixed camera, board in the gripper) or eye-in-hand (camera on the wrist, fixed board)."""
Agreement: TypeAlias = Literal["agrees", "differs", "open"]
Three: TypeAlias = tuple[float, float, float]

_SEEN_BEND_PX = 0.5
"""Distortion [pixel] that counts as none: half a pixel is 0.6 mm at 0.7 m and a focal length of 600 pixels."""


@final
@dataclass(frozen=True, kw_only=True)
class Spread:
    """Diversity of the poses of the views: the larger, the better determined is the calibration.

    `turns_deg`: root mean squares of the rotations from their mean about three perpendicular axes, the largest first;
    `shifts_m`: the same of the positions. Rotations about a single axis leave the camera's position undetermined.
    """

    turns_deg: Three
    shifts_m: Three


@final
@dataclass(frozen=True, kw_only=True)
class LastCheck:
    """Finding of the last check, in words: the calibration `agrees`, `differs`, or was left `open`."""

    day: date
    verdict: Agreement
    said: str


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class HandEye:
    """A calibrated camera.

    `pose`: T_world_camera of a fixed camera, T_gripper_camera of one on the wrist; `board_pose`: T_gripper_board or
    T_world_board. `deviation_m` and `deviation_deg`: standard deviations along and about the axes of the frame that
    `pose` maps to. `views`: views used, without the `outliers`; `error_px`, `error_m`, `error_deg`: root mean squares
    of their residuals in the kinematic chain, in the image and as an error of the gripper's pose. `place` and `optics`:
    the last check since of the camera's pose, and of its intrinsics; None where there was none.
    """

    serial: str
    setup: Setup
    pose: Transform
    board_pose: Transform
    lens: Lens
    board: Charuco
    calibrated_at: date
    views: int
    outliers: int
    error_px: float
    error_m: float
    error_deg: float
    deviation_m: Three
    deviation_deg: Three
    spread: Spread
    place: LastCheck | None = None
    optics: LastCheck | None = None

    @property
    def known_at(self) -> date:
        """The day on which its pose was last confirmed: calibrated, or checked and found."""
        return self.place.day if self.place and self.place.verdict == "agrees" else self.calibrated_at

    @property
    def doubt(self) -> str:
        """Finding of a later check that contradicts the calibration; empty where there is none."""
        found = next((each for each in (self.place, self.optics) if each and each.verdict == "differs"), None)
        return f"checked on {found.day.isoformat()}: {found.said}" if found else ""

    def model(self, *, depth_unit_m: float) -> CameraModel:
        """The camera as its users take it. Raises UsageError where a CameraModel cannot express it."""
        if self.setup == "wrist":
            raise UsageError(
                f"Camera {self.serial!r} is on the wrist, so it stands elsewhere with every pose; only cameras that "
                "are fixed in the world can watch the table."
            )
        if self.lens.bend_px > _SEEN_BEND_PX:
            raise UsageError(
                f"The lens of camera {self.serial!r} bends its image by {self.lens.bend_px:.1f} pixels at the border, "
                "and pixels count as straight here; let the camera's driver rectify the stream, and calibrate that."
            )
        return CameraModel(
            name=self.serial,
            width=self.lens.width,
            height=self.lens.height,
            K=self.lens.K,
            T_world_camera=self.pose,
            depth_unit_m=depth_unit_m,
            calibrated_at=self.calibrated_at.isoformat(),
            checked_at=self.known_at.isoformat() if self.known_at != self.calibrated_at else "",
            doubt=self.doubt,
        )
