"""Camera mounts: the cameras of a rig and their poses."""

from dataclasses import dataclass, field, replace
from typing import Self, final

import numpy as np

from app.core.errors import DeviceError
from app.core.geometry.camera import CameraModel
from app.core.geometry.hand_eye import HandEye
from app.core.types import Intrinsics, Transform
from app.rig.realsense.memory import Identity
from app.rig.realsense.sdk.sources import Live, Source
from app.rig.realsense.settings import StreamSettings

_SAME_PX = 1.0
"""Tolerance [pixel] between the factory intrinsics and those of the calibration."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Mounted:
    """A mounted camera: `T_world_camera` is the pose of its colour imager, `calibrated_at` its day.

    `checked_at` and `doubt` as in `CameraModel`. `K` [pixel]: intrinsics of its calibration, None where it has none.
    """

    name: str
    source: Source
    T_world_camera: Transform = field(default_factory=lambda: np.eye(4))
    calibrated_at: str = ""
    checked_at: str = ""
    doubt: str = ""
    K: Intrinsics | None = None
    settings: StreamSettings = field(default_factory=StreamSettings)

    @classmethod
    def from_calibration(
        cls, found: HandEye, *, name: str, settings: StreamSettings, source: Source | None = None
    ) -> Self:
        """The camera of a calibration, with images of that size; on the bus where no other `source` is named.

        Raises UsageError where it is on the wrist, or was calibrated on distorted images, for these here are a
        pinhole's.
        """
        model = found.model(depth_unit_m=1.0)
        return cls(
            name=name,
            source=source or Live(serial=found.serial),
            T_world_camera=model.T_world_camera,
            calibrated_at=model.calibrated_at,
            checked_at=model.checked_at,
            doubt=model.doubt,
            K=model.K,
            settings=replace(settings, width=model.width, height=model.height),
        )

    def model(self, identity: Identity) -> CameraModel:
        """The camera as opened. Raises DeviceError where it differs from its calibration."""
        if self.K is not None and np.abs(identity.K - self.K).max() > _SAME_PX:
            said, was = (f"{K[0, 0]:.1f}, {K[1, 1]:.1f}, {K[0, 2]:.1f}, {K[1, 2]:.1f}" for K in (identity.K, self.K))
            raise DeviceError(
                f"Camera {self.name!r} ({identity.serial}) has fx, fy, cx, cy = {said}, and was calibrated with {was}; "
                "calibrate it again."
            )
        return CameraModel(
            name=self.name,
            width=self.settings.width,
            height=self.settings.height,
            K=identity.K,
            T_world_camera=self.T_world_camera,
            depth_unit_m=identity.depth_unit_m,
            calibrated_at=self.calibrated_at,
            checked_at=self.checked_at,
            doubt=self.doubt,
        )
