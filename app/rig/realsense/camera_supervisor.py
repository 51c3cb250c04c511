"""Camera supervisor: watches a capture process and executes the recovery policy, for as long as the rig is open."""

import os
import time
from multiprocessing.process import BaseProcess
from typing import final

import anyio
from anyio import to_thread

from app.core.system.processes import end, process, start_ordinary
from app.rig.realsense.capture import run_capture
from app.rig.realsense.memory import CaptureMemory, CaptureReport
from app.rig.realsense.recovery_policy import Action, CaptureStatus, Ladder, RecoveryTimeouts, climb
from app.rig.realsense.sdk.sources import Source
from app.rig.realsense.settings import StreamSettings

_TICK_S = 0.05
_LOOKS = 3
_KILL_S = 5.0
"""Time for the kernel to end a killed process; one that hangs in the kernel stays, and the camera with it."""


@final
class Keeper:
    """Supervisor of the capture process of the camera `name`, and its state in the recovery policy.

    `known`: it has given an image, or was searched for several times in vain.
    """

    def __init__(self, name: str, source: Source, settings: StreamSettings, timeouts: RecoveryTimeouts) -> None:
        self.memory = CaptureMemory(settings)
        self.known, self._in_vain = anyio.Event(), 0
        self._name, self._source, self._settings, self._timeouts = name, source, settings, timeouts
        self._process: BaseProcess | None = None
        self._ladder = Ladder.at_start(time.monotonic())

    @property
    def words(self) -> str:
        """State of the camera for an operator."""
        return self._ladder.words(time.monotonic())

    @property
    def has_streamed(self) -> bool:
        """True once images have come."""
        return self._ladder.streamed

    @property
    def pid(self) -> int | None:
        """Process id of the present capture process."""
        return self._process.pid if self._process else None

    async def run(self) -> None:
        """Start the camera and supervise it until cancelled; its process has ended then."""
        try:
            await to_thread.run_sync(self._replace)
            self._ladder = Ladder.at_start(time.monotonic())
            while True:
                await anyio.sleep(_TICK_S)
                action = self._climb(self._sight())
                if action is not None:
                    await self._act(action)
        finally:
            with anyio.CancelScope(shield=True):
                await to_thread.run_sync(self._end)

    def _climb(self, sight: CaptureStatus) -> Action | None:
        former, (self._ladder, action) = self._ladder, climb(self._ladder, sight, self._timeouts)
        if sight.absent and self._ladder.phase == "waiting" != former.phase:
            self._in_vain += 1
        if self.has_streamed or self._in_vain >= _LOOKS:
            self.known.set()
        return action

    async def _act(self, action: Action) -> None:
        if action == "replace":
            await to_thread.run_sync(self._replace)
        else:
            self.memory.tell(action)

    def _sight(self) -> CaptureStatus:
        """Observation of the process now."""
        said, told = self.memory.last_report, self.memory.last_command[0]
        assert said is not None, "a process that was started has been reported as opening"
        return CaptureStatus(
            now_s=time.monotonic(),
            pulse_s=self.memory.pulse_s,
            image_s=self.memory.image_s,
            step=said.step if said.command == told else "asked",
            failure=said.text,
            absent=said.absent,
            death=self._death(),
        )

    def _death(self) -> str:
        if self._process is None or self._process.is_alive():
            return ""
        return f"its process ended with code {self._process.exitcode}"

    def _replace(self) -> None:
        """End the process, if there is one, and start a new one that opens the camera. Blocks."""
        if self._process is not None:
            self._process.kill()
            self._process.join(_KILL_S)
        number = self.memory.tell("open")
        self.memory.report(CaptureReport(command=number, step="opening", absent=False, text=""))
        arguments = (self.memory, self._source, self._settings, os.getpid())
        self._process = process(f"camera {self._name}", run_capture, *arguments)
        start_ordinary(self._process)

    def _end(self) -> None:
        """Have the process stop its stream; kill one that does not. Blocks."""
        if self._process is None:
            return
        self.memory.closing.value = 1
        end([self._process])
