"""Who moves the tool by hand: samples of browsers in, jogs to the arm out, and what is done or why not in words."""

import threading
import time
from collections.abc import Callable
from typing import final

import numpy as np

from app.config import Limits
from app.core.errors import ParameterError
from app.core.jog import Jog
from app.core.types import ToolPose
from app.teleop import mapping
from app.teleop.deadman import AGAIN, DeadMan
from app.teleop.sample import Sample, read_sample

MOVING, RESTING, ARRIVED = "moving", "live, nothing held that moves", "there"
NOT_HEEDED = f"the program is busy with something else: {AGAIN} in a moment"


@final
class Pilot:
    """Called by the thread that hears the browsers; nothing of it waits for the program's event loop.

    `jog` hands a velocity to the arm and says whether it is heeded, `tool` is where the tool is; neither may block.
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
        """Do what a browser's sample says; in words what is done, or why nothing is.

        `refused`: why this operator may move nothing now, None where he may. Whatever is refused wants a new press.
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
            said = self._moved(sample) if man.live else man.why
            if before.live and not man.live:
                self._jog(Jog())
            self._deadmen[operator] = man.off(said) if said == NOT_HEEDED else man
            return said

    def tool(self) -> ToolPose:
        """Where the tool is."""
        return self._tool()

    def aim(self, position: mapping.Place) -> None:
        """Go to `position` [m] from now on where a browser says towards; the nearest in the workspace is meant."""
        if np.isfinite(position).all():
            box = self._limits.workspace
            self._aim = np.clip(position, box.low, box.high)

    def let_go(self, operator: str) -> None:
        """A browser is heard no more; what it held is held no more, and if it comes back it has to press again."""
        with self._lock:
            man = self._deadmen.get(operator, DeadMan())
            self._deadmen[operator] = man.off(f"the page was not heard: {AGAIN}")
            if man.live:
                self._jog(Jog())

    def _moved(self, sample: Sample) -> str:
        if sample.towards and self._aim is None:
            self._jog(Jog())
            return "there is no aim to go to"
        jog = mapping.jog(sample, self._tool(), self._aim, self._limits)
        if not self._jog(jog):
            return NOT_HEEDED
        if jog.linear.any() or jog.angular.any() or jog.opening:
            return MOVING
        return ARRIVED if sample.towards else RESTING
