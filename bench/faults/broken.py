"""Ports with injected faults: a clock that stands still, and cameras with impossible images."""

import dataclasses
import time
from collections.abc import Sequence
from typing import Final, Literal, TypeAlias, final, get_args

import anyio
import numpy as np

from app.core.geometry.arm_geometry import ArmShape
from app.core.geometry.camera import CameraModel
from app.core.messages import Frame
from app.core.ports import Arm, Camera, Posed, Rig

Shows: TypeAlias = Literal["all", "nothing", "rope everywhere", "nan"]
"""Content of the images: the scene; black without depth; an object as large as the image; non-finite poses."""
SHOWS: Final[tuple[Shows, ...]] = get_args(Shows)
_ROPE_RGB: Final = np.array([230, 64, 20], np.uint8)
_NEAR_MM: Final = np.uint16(700)


@final
class FaultyClock:
    """The machine's clock, which stands still until `thaws_s`: sleepers do not wake up before."""

    def __init__(self) -> None:
        self._froze_s = self._thaws_s = 0.0

    def freeze(self, duration_s: float) -> None:
        """Stand still from now on."""
        self._froze_s = time.monotonic()
        self._thaws_s = self._froze_s + duration_s

    def now(self) -> float:
        """Monotonic time [s]."""
        now_s = time.monotonic()
        return self._froze_s if now_s < self._thaws_s else now_s

    async def sleep(self, duration_s: float) -> None:
        """Wait, and for as long as it stands still."""
        await anyio.sleep(duration_s)
        await anyio.sleep(max(0.0, self._thaws_s - time.monotonic()))

    def move_on_after(self, duration_s: float | None) -> anyio.CancelScope:
        """Cancel scope with a deadline, which passes while it stands still, too."""
        return anyio.move_on_after(duration_s)


@final
class FaultyCamera:
    """A camera of the rig, with frames corrupted by `shows`."""

    def __init__(self, camera: Camera) -> None:
        self._camera = camera
        self.shows: Shows = "all"

    @property
    def model(self) -> CameraModel:
        """Calibration of the camera."""
        return self._camera.model

    @property
    def words(self) -> str:
        """Status text of the camera."""
        return self._camera.words

    async def read(self) -> Frame:
        """The next frame. Raises DeviceError as the camera does."""
        frame = await self._camera.read()
        color, depth = np.zeros_like(frame.color), np.zeros_like(frame.depth)
        match self.shows:
            case "all":
                return frame
            case "nothing":
                return dataclasses.replace(frame, color=color, depth=depth)
            case "rope everywhere":
                return dataclasses.replace(frame, color=color + _ROPE_RGB, depth=depth + _NEAR_MM)
            case "nan":
                model = dataclasses.replace(frame.camera, T_world_camera=np.full((4, 4), np.nan))
                return dataclasses.replace(frame, camera=model)


@final
class FaultyRig:
    """A rig with such cameras; all else is as it is."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._cameras = [FaultyCamera(camera) for camera in rig.cameras]

    @property
    def name(self) -> str:
        """Name of the rig."""
        return self._rig.name

    @property
    def simulated(self) -> bool:
        """True if the rig is simulated."""
        return self._rig.simulated

    @property
    def shape(self) -> ArmShape | None:
        """Shape of its arm."""
        return self._rig.shape

    @property
    def seen_arm(self) -> Posed:
        """Arm as seen by cameras: that of the rig."""
        return self._rig.seen_arm

    @property
    def cameras(self) -> Sequence[FaultyCamera]:
        """All of them, to be spoilt."""
        return self._cameras

    @property
    def arm(self) -> Arm:
        """Arm of the rig."""
        return self._rig.arm
