"""A camera of a recording, as the application sees it."""

from typing import Final, final

import anyio

from app.core.errors import DeviceError, RecordingError
from app.core.geometry.camera import CameraModel
from app.core.messages import Frame
from app.core.system.clock import PollDeadline
from app.rig.replayed.projector import Projector

_POLL_S: Final = 0.01


@final
class ReplayedCamera:
    """Replay of the camera `model`; `words`: a note on images that are left out."""

    def __init__(self, model: CameraModel, projector: Projector, *, words: str, timeout_s: float) -> None:
        self._model, self._words = model, words
        self._projector, self._timeout_s = projector, timeout_s
        self._read: Frame | None = None

    @property
    def model(self) -> CameraModel:
        """Its recorded calibration."""
        return self._model

    @property
    def words(self) -> str:
        """Note on its images that are left out; empty where few are."""
        return self._words

    async def read(self) -> Frame:
        """The newest image, once there is one that is newer than the last one read, dated when it was shown.

        Raises DeviceError where none comes in time, such as in a gap of the recording, and where the recording has
        become unreadable.
        """
        deadline = PollDeadline(self._timeout_s)
        while not deadline.is_over():
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
