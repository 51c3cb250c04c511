"""Frames from a camera process's shared memory: awaited, and never stale."""

import time
from collections.abc import Callable
from typing import Any, final

import anyio
import numpy as np

from app.core.geometry.camera import CameraModel
from app.core.messages import Frame, fresh_id
from app.core.system.clock import PollDeadline
from app.core.system.ring import Ring

_POLL_S = 0.01


def image_ring(width: int, height: int, *, kept: int) -> Ring:
    """Ring of the last `kept` pairs of images: `time_s` of the exposure, `color` and `depth`."""
    size = (height, width)
    return Ring(np.dtype([("time_s", "f8"), ("color", "u1", (*size, 3)), ("depth", "u2", size)]), kept)


@final
class SharedMemoryCamera:
    """The newest images of the camera `model`, each read once.

    `timeout_s`: time to wait for an image. `oldest_s`: older ones are discarded. `period_s`: shortest time between
    frames, where images come more often than they are read.
    """

    def __init__(
        self, model: CameraModel, images: Ring, *, timeout_s: float, oldest_s: float = np.inf, period_s: float = 0.0
    ) -> None:
        self.model = model
        self._images, self._timeout_s = images, timeout_s
        self._oldest_s, self._period_s = oldest_s, period_s
        self._read, self._read_s = 0, -np.inf

    async def read(self, check: Callable[[], None]) -> Frame | None:
        """The newest image, once there is one that is due; None where there is none in time.

        While waiting it calls `check` repeatedly; an error of that ends the wait.
        """
        deadline = PollDeadline(self._timeout_s)
        while (frame := self._newest()) is None and not deadline.is_over():
            check()
            await anyio.sleep(_POLL_S)
        return frame

    def _newest(self) -> Frame | None:
        count = self._images.count
        if count <= self._read:
            return None
        image: Any = self._images.newest()
        time_s = float(image["time_s"])
        overwritten = self._images.count - count >= self._images.capacity - 1
        early, old = time_s < self._read_s + self._period_s, time.monotonic() - time_s > self._oldest_s
        if overwritten or early or old:
            return None
        self._read, self._read_s = count, time_s
        return Frame(id=fresh_id("frame"), time_s=time_s, camera=self.model, color=image["color"], depth=image["depth"])
