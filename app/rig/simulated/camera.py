"""A camera of the simulated rig, as the application sees it."""

from multiprocessing.process import BaseProcess
from typing import final

import anyio

from app.config import Timing
from app.core.camera import CameraModel
from app.core.errors import DeviceError
from app.core.messages import Frame, fresh_id
from app.core.ring import Ring

_POLL_S = 0.01


@final
class SimulatedCamera:
    """Reads the images that the cameras' process leaves in shared memory."""

    def __init__(self, model: CameraModel, images: Ring, eyes: BaseProcess, world: BaseProcess, timing: Timing) -> None:
        self._model, self._images, self._timing = model, images, timing
        self._processes = (eyes, world)
        self._read = 0

    @property
    def model(self) -> CameraModel:
        """Its calibration."""
        return self._model

    async def read(self) -> Frame:
        """The newest image, once there is one that is newer than the last one read.

        Raises DeviceError where none comes in `camera_timeout_s`, or its process or the world's has ended.
        """
        with anyio.move_on_after(self._timing.camera_timeout_s):
            while self._images.count <= self._read:
                self._check_alive()
                await anyio.sleep(_POLL_S)
            self._read = self._images.count
            image = self._images.newest()
            return Frame(
                id=fresh_id("frame"),
                time_s=float(image["time_s"]),
                camera=self._model,
                color=image["color"],
                depth=image["depth"],
            )
        raise DeviceError(
            f"Camera {self._model.name!r} gave no image for {self._timing.camera_timeout_s:g} s; "
            "close the rig and open it again."
        )

    def _check_alive(self) -> None:
        for process in self._processes:
            if not process.is_alive():
                raise DeviceError(
                    f"The {process.name} process ended with code {process.exitcode}, so camera "
                    f"{self._model.name!r} sees nothing; close the rig and open it again."
                )
