"""A camera that shows images rendered by another process, for a rehearsal of the whole application.

The images are given to a software camera of the SDK, so they pass its syncer, pipeline and alignment.
"""

import threading
import time
from collections.abc import Generator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Self, final

from app.core.errors import DeviceError
from app.core.shared_memory_camera import image_ring
from app.core.system.ring import Ring, Stamp
from app.rig.realsense.sdk.sdk import Opening, Sdk
from app.rig.realsense.sdk.software import CameraDescription, SoftwareCamera
from app.rig.realsense.sdk.sources import CameraAbsent
from app.rig.realsense.sdk.timestamping import ClockReading

_POLL_S = 0.002
_KEPT = 4


@final
class Feed:
    """Ring of rendered images for a camera, in shared memory; its construction blocks.

    `images`: the renderer appends `time_s` (monotonic, of the exposure), `color` and `depth` as the two imagers see
    them. Both have one size here.
    """

    def __init__(self, images: Ring) -> None:
        self.images = images
        self._unplugged = Stamp()

    @classmethod
    def of(cls, body: CameraDescription) -> Self:
        """A feed for a camera with this `body`."""
        return cls(image_ring(body.color.width, body.color.height, kept=_KEPT))

    @property
    def is_plugged(self) -> bool:
        """True while the camera can be found; set it to pull its cable and to plug it in again."""
        return not self._unplugged.value

    @is_plugged.setter
    def is_plugged(self, plugged: bool) -> None:
        self._unplugged.value = int(not plugged)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Rendered:
    """Images from `feed`, as if taken by a camera with this `body`."""

    body: CameraDescription
    feed: Feed

    @property
    def serial(self) -> str:
        """Serial number of the body."""
        return self.body.serial

    def attach(self, opening: Opening, /) -> AbstractContextManager[None]:
        """Select a software camera that shows the images of the feed."""
        if not self.feed.is_plugged:
            raise CameraAbsent(f"The rendered camera {self.serial!r} is unplugged.")
        camera = SoftwareCamera(opening.sdk.rs, self.body)
        opening.pipeline.set_device(camera.device)
        return _feeding(camera, self.feed)

    def reset(self, _: Sdk, /) -> None:
        """Raises DeviceError: there is no hardware."""
        raise DeviceError(f"Camera {self.serial!r} is rendered, which leaves nothing to reset.")


@contextmanager
def _feeding(camera: SoftwareCamera, feed: Feed) -> Generator[None]:
    """Show every new image of `feed`, in a thread, until the block is left."""
    over = threading.Event()
    thread = threading.Thread(target=_feed, args=(camera, feed, over), name="feed", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def _feed(camera: SoftwareCamera, feed: Feed, over: threading.Event) -> None:
    shown = feed.images.count
    while not over.is_set():
        if feed.images.count == shown or not feed.is_plugged:
            time.sleep(_POLL_S)
            continue
        shown, image = feed.images.count, feed.images.newest()
        now = ClockReading.now()
        stamp_s = float(image["time_s"]) - now.monotonic_s + now.calendar_s
        camera.show(image["color"], image["depth"], stamp_s=stamp_s)
