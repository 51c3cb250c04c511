"""Teleoperation controller: browser samples in, jogs to the arm out, and a status text for each."""

import threading
import time
from collections.abc import Callable
from typing import final

import numpy as np

from app.config import Limits
from app.core.dialogue.jog import Jog
from app.core.errors import ParameterError
from app.core.types import ToolPose
from app.teleop import mapping
from app.teleop.deadman import AGAIN, DeadMan
from app.teleop.sample import Sample, read_sample

MOVING, RESTING, ARRIVED = "moving", "live, nothing held that moves", "there"
NOT_HEEDED = f"the program is busy with something else: {AGAIN} in a moment"


@final
class Pilot:
    """Controller called by the thread that receives the samples; it never waits for the program's event loop.

    `jog` hands a velocity to the arm and returns True where it is accepted, `tool` is the tool's pose; neither may
    block.
    """

    def __init__(
        self,
        *,
        jog: Callable[[Jog], bool],
        tool: Callable[[], ToolPose],
        limits: Limits,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._jog, self._tool, self._limits, self._now = jog, tool, limits, now
        self._lock = threading.Lock()
        self._deadmen: dict[str, DeadMan] = {}
        self._aim: mapping.Place | None = None

    def sample(self, operator: str, data: bytes, *, refused: str | None) -> str:
        """Execute a browser's sample; returns its effect in words, or the reason for none.

        `refused`: reason why this operator may not move the arm now, None where allowed. Anything refused needs a new
        press.
        """
        try:
            sample = read_sample(data)
        except ParameterError as error:
            return str(error)
        with self._lock:
            before = self._deadmen.get(operator, DeadMan())
            man = before.after(sample, self._now())
            if man is before:
                return "too late"
            if sample.held and refused is not None:
                man = man.off(refused)
            said = self._follow_sample(sample) if man.live else man.why
            if before.live and not man.live:
                self._jog(Jog())
            self._deadmen[operator] = man.off(said) if said == NOT_HEEDED else man
            return said

    def tool(self) -> ToolPose:
        """Pose of the tool."""
        return self._tool()

    def aim(self, position: mapping.Place) -> None:
        """Set the target of "towards" samples to `position` [m], clipped to the workspace."""
        if np.isfinite(position).all():
            box = self._limits.workspace
            self._aim = np.clip(position, box.low, box.high)

    def let_go(self, operator: str) -> None:
        """Release an operator's controls after a disconnect; on return a new press is needed."""
        with self._lock:
            man = self._deadmen.get(operator, DeadMan())
            self._deadmen[operator] = man.off(f"the page was not heard: {AGAIN}")
            if man.live:
                self._jog(Jog())

    def _follow_sample(self, sample: Sample) -> str:
        if sample.towards and self._aim is None:
            self._jog(Jog())
            return "there is no aim to go to"
        jog = mapping.jog(sample, self._tool(), self._aim, self._limits)
        if not self._jog(jog):
            return NOT_HEEDED
        if jog.linear.any() or jog.angular.any() or jog.opening:
            return MOVING
        return ARRIVED if sample.towards else RESTING
