"""Where a camera is, as a calibration with a board found it: to be kept in a file, and to be told."""

from dataclasses import dataclass
from datetime import date
from typing import Literal, TypeAlias, final

from app.core.camera import CameraModel
from app.core.charuco import Charuco
from app.core.errors import UsageError
from app.core.lens import Lens
from app.core.types import Transform

Setup: TypeAlias = Literal["fixed", "wrist"]
"""The camera stands in the world and the gripper holds the board, or it is on the wrist and the board stands."""
Verdict: TypeAlias = Literal["agrees", "differs", "open"]
Three: TypeAlias = tuple[float, float, float]

_SEEN_BEND_PX = 0.5
"""What a lens may bend unnoticed: half a pixel is 0.6 mm at 0.7 m and a focal length of 600 pixels."""


@final
@dataclass(frozen=True, kw_only=True)
class Spread:
    """How much the poses of the views differ: the more, the surer is what is made of them.

    `turns_deg`: root mean squares of the rotations from their mean about three perpendicular axes, the largest first;
    `shifts_m`: the same of the positions. One axis of rotation alone leaves the camera's place open.
    """

    turns_deg: Three
    shifts_m: Three


@final
@dataclass(frozen=True, kw_only=True)
class LastCheck:
    """What a check found on that day, in words: what was calibrated `agrees`, `differs`, or was left `open`."""

    day: date
    verdict: Verdict
    said: str


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class HandEye:
    """A calibrated camera.

    `pose`: T_world_camera of one that is fixed, T_gripper_camera of one on the wrist; `board_pose`: T_gripper_board or
    T_world_board. `deviation_m` and `deviation_deg`: standard deviations along and about the axes of the frame that
    `pose` goes to. `views`: how many it is from, without the `outliers`; `error_px`, `error_m`, `error_deg`: root mean
    squares of what those miss the chain by, in the image and as an error of the gripper's pose. `place` and `optics`:
    the last check since of where the camera stands, and of its intrinsics; None where there was none.
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
        """The day on which its place was known last: calibrated, or checked and found."""
        return self.place.day if self.place and self.place.verdict == "agrees" else self.calibrated_at

    @property
    def doubt(self) -> str:
        """What a check has found since that does not fit; empty where none has."""
        found = next((each for each in (self.place, self.optics) if each and each.verdict == "differs"), None)
        return f"checked on {found.day.isoformat()}: {found.said}" if found else ""

    def model(self, *, depth_unit_m: float) -> CameraModel:
        """The camera for all that has images of it. Raises UsageError where it is not what a CameraModel can say."""
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
