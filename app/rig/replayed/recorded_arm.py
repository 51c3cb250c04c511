"""The arm in the images of a recording, at its recorded configurations."""

from bisect import bisect_left
from collections.abc import Callable, Sequence
from typing import final

from app.core.arm_pose_history import pose_at
from app.core.geometry.arm_geometry import JointAngles, JointState
from app.core.messages import ArmState
from app.core.types import ToolPose


@final
class RecordedArm:
    """Interpolation between the recorded `states`; `recorded_s`: the moment that is shown now [s].

    They were recorded about twice a second, so a fast motion is known to a few centimetres, and a rest exactly. It
    takes no commands.
    """

    def __init__(self, states: Sequence[ArmState], recorded_s: Callable[[], float]) -> None:
        self._times_s = [state.time_s for state in states]
        self._postures = [JointState(joints=state.joints, tool=state.tool) for state in states]
        self._recorded_s = recorded_s

    def tool(self) -> ToolPose:
        """Pose and opening of the tool in the present images; from any thread."""
        return self._posture().tool

    def joints(self) -> JointAngles:
        """Joint angles in the present images; from any thread."""
        return self._posture().joints

    def _posture(self) -> JointState:
        time_s = self._recorded_s()
        later = bisect_left(self._times_s, time_s)
        around = slice(max(later - 1, 0), later + 1)
        return pose_at(list(zip(self._times_s[around], self._postures[around], strict=True)), time_s)
