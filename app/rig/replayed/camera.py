"""A camera of a recording, as the application sees it."""

from typing import Final, final

import anyio

from app.core.camera import CameraModel
from app.core.errors import DeviceError, RecordingError
from app.core.messages import Frame
from app.rig.replayed.projector import Projector

_POLL_S: Final = 0.01


@final
class ReplayedCamera:
    """Shows what the camera `model` saw when the recording was made; `words`: what of that is not shown."""

    def __init__(self, model: CameraModel, projector: Projector, *, words: str, timeout_s: float) -> None:
        self._model, self._words = model, words
        self._projector, self._timeout_s = projector, timeout_s
        self._read: Frame | None = None

    @property
    def model(self) -> CameraModel:
        """Its calibration of then."""
        return self._model

    @property
    def words(self) -> str:
        """What of its images is left out, where much is."""
        return self._words

    async def read(self) -> Frame:
        """The newest image, once there is one that is newer than the last one read, dated when it was shown.

        Raises DeviceError where none comes in time, as where its camera saw nothing for so long, and where the
        recording cannot be read any more.
        """
        with anyio.move_on_after(self._timeout_s):
            while True:
                frame = self._newest()
                if frame is not None and frame is not self._read:
                    self._read = frame
                    return frame
                await anyio.sleep(_POLL_S)
        raise DeviceError(
            f"Camera {self._model.name!r} gave no image for {self._timeout_s:g} s in the recording either; wait until "
            "the others have gone on to where it did, or use another recording."
        )

    def _newest(self) -> Frame | None:
        try:
            return self._projector.newest(self._model.name)
        except RecordingError as error:
            raise DeviceError(f"Camera {self._model.name!r} shows no more: {error}") from error
