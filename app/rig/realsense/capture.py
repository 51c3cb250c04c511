"""A capture process: one camera, streaming on command, its images left in shared memory.

It decides nothing: it executes the last command, reports its current step and sends heartbeats, so that its supervisor
can detect a hanging call of the SDK, and end the process.
"""

import os
import time
from contextlib import ExitStack
from typing import final

from app.core.errors import DeviceError
from app.rig.realsense.memory import Arrived, CaptureMemory, CaptureReport, Identity
from app.rig.realsense.recovery_policy import Step
from app.rig.realsense.sdk.device_enumeration import find
from app.rig.realsense.sdk.sdk import Sdk
from app.rig.realsense.sdk.sources import CameraAbsent, Source
from app.rig.realsense.sdk.timestamping import Dating
from app.rig.realsense.settings import StreamSettings
from app.rig.realsense.stream import AlignedImages, OpenedCamera, Stream, StreamEnded, streaming

_IDLE_S = 0.02
_GONE_S, _BACK_S, _CALM_S = 3.0, 15.0, 1.0
"""Times after a reset: until the camera has left the bus, until it is back, and before it is opened then: the SDK
was seen to crash when it opens one at once (librealsense issue 11304)."""


def run_capture(memory: CaptureMemory, source: Source, settings: StreamSettings, parent: int) -> None:
    """Body of the process: execute commands until closed or until `parent` is gone."""
    memory.beat()
    capture = _Capture(memory, source, settings)
    while not memory.closing.value and os.getppid() == parent:
        memory.beat()
        capture.go_on()
    capture.close()


@final
class _Capture:
    """State machine of a capture process, advanced in short steps."""

    def __init__(self, memory: CaptureMemory, source: Source, settings: StreamSettings) -> None:
        self._memory, self._source, self._settings = memory, source, settings
        self._sdk = Sdk.load()
        self._open = ExitStack()
        self._stream: Stream | None = None
        self._dating, self._last_s = Dating(period_s=settings.period_s), float("-inf")
        self._done = 0

    def go_on(self) -> None:
        """Execute a new command, or read an image; a failure is reported, and left to the supervisor."""
        try:
            if self._memory.last_command[0] != self._done:
                self._obey()
            elif self._stream is None:
                time.sleep(_IDLE_S)
            else:
                self._look(self._stream)
        except StreamEnded as error:
            self._fail("ended", error)
        except DeviceError as error:
            self._fail("failed", error)

    def close(self) -> None:
        """Stop the stream, if there is one. Raises DeviceError where the camera fails to stop."""
        self._stream = None
        self._say("closing")
        self._open.close()

    def _fail(self, step: Step, error: DeviceError) -> None:
        self._stream = None
        self._say(step, str(error), absent=isinstance(error, CameraAbsent))

    def _obey(self) -> None:
        self._done, command = self._memory.last_command
        if command == "open":
            self.close()
        else:
            self._reset()
        self._say("opening")
        stream = self._open.enter_context(streaming(self._sdk, self._source, self._settings))
        self._memory.introduce(_identity(stream.opened))
        self._stream = stream
        self._say("streaming")

    def _reset(self) -> None:
        """Reset the camera as it is; stopping its stream first was seen to hang (librealsense issue 7252)."""
        self._say("resetting")
        self._source.reset(self._sdk)
        self._await(there=False, within_s=_GONE_S)
        self.close()
        self._await(there=True, within_s=_BACK_S)
        self._rest(_CALM_S)

    def _await(self, *, there: bool, within_s: float) -> None:
        """Wait at most `within_s` until the camera is on the bus, or is not."""
        end_s = time.monotonic() + within_s
        while time.monotonic() < end_s:
            if there == any(listed.serial == self._source.serial for listed in find(self._sdk)):
                return
            self._rest(0.1)

    def _rest(self, duration_s: float) -> None:
        end_s = time.monotonic() + duration_s
        while (left_s := end_s - time.monotonic()) > 0:
            self._memory.beat()
            time.sleep(min(left_s, 0.1))

    def _look(self, stream: Stream) -> None:
        shot = stream.next()
        if shot is not None:
            self._keep(shot)

    def _keep(self, shot: AlignedImages) -> None:
        """Publish the images to the application, unless they repeat the last ones."""
        dated, self._dating = self._dating.date(shot.stamp_s, shot.domain, shot.arrival)
        if dated is None or dated.time_s <= self._last_s:
            return
        self._last_s = dated.time_s
        arrived = Arrived(
            time_s=dated.time_s,
            arrival_s=shot.arrival.monotonic_s,
            error_s=dated.error_s,
            domain=shot.domain,
            by=dated.by,
        )
        self._memory.arrive(arrived, shot.color, shot.depth)

    def _say(self, step: Step, text: str = "", *, absent: bool = False) -> None:
        self._memory.report(CaptureReport(command=self._done, step=step, absent=absent, text=text))


def _identity(opened: OpenedCamera) -> Identity:
    listed = opened.listed
    return Identity(
        name=listed.name,
        serial=listed.serial,
        firmware=listed.firmware,
        usb=listed.usb,
        K=opened.K,
        depth_unit_m=opened.depth_unit_m,
        warning=opened.warning,
    )
