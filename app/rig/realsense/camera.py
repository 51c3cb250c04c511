"""A RealSense camera as the application sees it."""

from typing import final

import numpy as np

from app.core.errors import DeviceError
from app.core.geometry.camera import CameraModel
from app.core.messages import Frame
from app.core.shared_memory_camera import SharedMemoryCamera
from app.rig.realsense.camera_supervisor import Keeper
from app.rig.realsense.memory import Arrived

_SAME_PX, _SAME_UNIT = 0.01, 1e-3


@final
class RealSenseCamera:
    """Reads the images that a capture process leaves in shared memory; `keeper` supervises that process."""

    def __init__(self, view: SharedMemoryCamera, keeper: Keeper) -> None:
        self._view, self._keeper = view, keeper

    @property
    def model(self) -> CameraModel:
        """Its calibration."""
        return self._view.model

    @property
    def words(self) -> str:
        """Problem and recovery in progress, or a warning about the connection; empty where all is well."""
        identity = self._keeper.memory.identity
        return self._keeper.words or (identity.warning if identity else "")

    @property
    def arrival(self) -> Arrived | None:
        """Timestamps of the newest image."""
        return self._keeper.memory.arrival

    async def read(self) -> Frame:
        """The newest image, once one is due that is newer than the last one read.

        Raises DeviceError where none comes within the timeout of the site, with the problem and the recovery in
        progress, and where a different camera came back.
        """
        frame = await self._view.read(self._check_same)
        if frame is not None:
            self._check_same()
            return frame
        raise DeviceError(f"Camera {self.model.name!r} shows nothing: {self._keeper.words or 'its images are old'}.")

    def _check_same(self) -> None:
        identity, model = self._keeper.memory.identity, self.model
        assert identity is not None, "the model was made from it"
        moved = np.abs(identity.K - model.K).max() > _SAME_PX
        if moved or abs(identity.depth_unit_m / model.depth_unit_m - 1) > _SAME_UNIT:
            raise DeviceError(
                f"Camera {model.name!r} came back with other intrinsics or another depth unit than it had; close the "
                "program and start it again."
            )
