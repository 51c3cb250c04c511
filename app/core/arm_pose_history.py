"""History of the arm's pose over the last seconds: camera images need the pose at their own time."""

from collections import deque
from collections.abc import Sequence
from typing import final

import numpy as np

from app.core.geometry.arm_geometry import JointState
from app.core.ports import Clock, Posed
from app.core.types import ToolPath

_PERIOD_S = 0.040
"""Sampling period: at 0.3 m/s the tool moves 12 mm in it; poses between samples are interpolated."""
_KEPT = 250
"""Ten seconds: no camera is so late."""
_HALF = 0.5


@final
class Following:
    """Sampler of the arm's pose, all the time."""

    def __init__(self, arm: Posed, clock: Clock) -> None:
        self._arm, self._clock = arm, clock
        self._past = deque[tuple[float, JointState]](maxlen=_KEPT)

    async def run(self) -> None:
        """Sample for ever."""
        while True:
            self.sample()
            await self._clock.sleep(_PERIOD_S)

    def sample(self) -> None:
        """Note where the arm is now."""
        self._past.append((self._clock.now(), JointState(joints=self._arm.joints(), tool=self._arm.tool())))

    def at(self, time_s: float) -> JointState:
        """The arm's pose at that time [s]; beyond the samples the nearest."""
        if not self._past:
            self.sample()
        return pose_at(self._past, time_s)

    def way(self, since_s: float, until_s: float) -> ToolPath:
        """Path of the tool between two times [s], in order."""
        between = [posture.tool for at_s, posture in self._past if since_s < at_s < until_s]
        return np.array([self.at(since_s).tool, *between, self.at(until_s).tool])


def pose_at(past: Sequence[tuple[float, JointState]], time_s: float) -> JointState:
    """Pose at `time_s` [s], interpolated between the samples of the `past`; beyond them the nearest."""
    later = next((index for index, (at_s, _) in enumerate(past) if at_s >= time_s), None)
    if later is None:
        return past[-1][1]
    if later == 0:
        return past[0][1]
    (before_s, before), (after_s, after) = past[later - 1], past[later]
    share = (time_s - before_s) / (after_s - before_s)
    # By the shorter way round: a joint that passes half a turn is measured on its other side.
    turned = np.angle(np.exp(1j * (after.joints - before.joints)))
    # Its turn is that of the nearer sample: in 40 ms a tool turns by 2 degrees at most.
    tool = (before if share < _HALF else after).tool.copy()
    tool[:3] = before.tool[:3] + share * (after.tool[:3] - before.tool[:3])
    return JointState(joints=before.joints + share * turned, tool=tool)
