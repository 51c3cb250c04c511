"""A camera of the simulated rig, as the application sees it."""

from multiprocessing.process import BaseProcess
from typing import final

from app.config import Timing
from app.core.errors import DeviceError
from app.core.geometry.camera import CameraModel
from app.core.messages import Frame
from app.core.shared_memory_camera import SharedMemoryCamera
from app.core.system.ring import Ring


@final
class SimulatedCamera:
    """Reader of the images that the cameras' process leaves in shared memory."""

    def __init__(self, model: CameraModel, images: Ring, eyes: BaseProcess, world: BaseProcess, timing: Timing) -> None:
        self._view = SharedMemoryCamera(model, images, timeout_s=timing.camera_timeout_s)
        self._timeout_s = timing.camera_timeout_s
        self._processes = (eyes, world)

    @property
    def model(self) -> CameraModel:
        """Its calibration."""
        return self._view.model

    @property
    def words(self) -> str:
        """Empty: a simulated camera works, or its process is gone, which `read` reports."""
        return ""

    async def read(self) -> Frame:
        """The newest image, once there is one that is newer than the last one read.

        Raises DeviceError where none comes in `camera_timeout_s`, or its process or the world's has ended.
        """
        frame = await self._view.read(self._check_alive)
        if frame is not None:
            return frame
        raise DeviceError(
            f"Camera {self.model.name!r} gave no image for {self._timeout_s:g} s, as this computer is too busy to draw "
            "one; end other programs, or wait until it has time."
        )

    def _check_alive(self) -> None:
        for process in self._processes:
            if not process.is_alive():
                raise DeviceError(
                    f"The {process.name} process ended with code {process.exitcode}, so camera "
                    f"{self.model.name!r} sees nothing; close the rig and open it again."
                )
