"""Image sources of a capture process: a camera on the bus or a recording; `rendered` has a third.

Each is data that can be sent to the process, and opens itself there; from the SDK's pipeline on, all are handled alike.
"""

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, final

from app.core.errors import DeviceError
from app.rig.realsense.sdk.device_enumeration import find
from app.rig.realsense.sdk.sdk import Opening, Sdk


class CameraAbsent(DeviceError):
    """There is no such camera now; it may be plugged in later."""


class Source(Protocol):
    """A source that a pipeline of the SDK can be opened on."""

    @property
    def serial(self) -> str:
        """The camera's serial number, or a stand-in for it."""
        ...

    def attach(self, opening: Opening, /) -> AbstractContextManager[None]:
        """Select the camera to open; the returned context is entered while it streams.

        Raises CameraAbsent where there is no such camera, DeviceError where it cannot be opened.
        """
        ...

    def reset(self, sdk: Sdk, /) -> None:
        """Reset the camera's hardware and return at once. Raises DeviceError where that is not possible."""
        ...


@final
@dataclass(frozen=True, kw_only=True)
class Live:
    """A camera on the bus."""

    serial: str

    def attach(self, opening: Opening, /) -> AbstractContextManager[None]:
        """Select the camera of this serial number."""
        opening.pipeline.set_device(self._device(opening.sdk))
        return nullcontext()

    def reset(self, sdk: Sdk, /) -> None:
        """Have the camera leave the bus and come back."""
        try:
            self._device(sdk).hardware_reset()
        except RuntimeError as error:
            raise DeviceError(f"Camera {self.serial!r} cannot be reset: {error}.") from error

    def _device(self, sdk: Sdk) -> Any:
        devices = {listed.serial: listed.device for listed in find(sdk)}
        if self.serial not in devices:
            there = f"there are {', '.join(sorted(devices))}" if devices else "there is none at all"
            raise CameraAbsent(
                f"No RealSense camera has the serial number {self.serial!r}: {there}. Check the number, cable and "
                "power; `dipac doctor` lists what is connected."
            )
        return devices[self.serial]


@final
@dataclass(frozen=True, kw_only=True)
class RecordedSource:
    """A recording of the SDK (.db3), at its recorded pace; `repeat`: start again after its end."""

    file: Path
    repeat: bool = False

    @property
    def serial(self) -> str:
        """Name of the file."""
        return self.file.name

    def attach(self, opening: Opening, /) -> AbstractContextManager[None]:
        """Select the recorded camera."""
        if not self.file.is_file():
            raise CameraAbsent(f"There is no recording {self.file}; `dipac` plays .db3 files of the RealSense SDK.")
        opening.config.enable_device_from_file(str(self.file), self.repeat)
        return nullcontext()

    def reset(self, _: Sdk, /) -> None:
        """Raises DeviceError: a recording has nothing to reset."""
        raise DeviceError(f"{self.file.name} is a recording, which cannot be reset.")
