"""The arm that is in the images of a recording: where it was when they were taken."""

from bisect import bisect_left
from collections.abc import Callable, Sequence
from typing import final

from app.core.limbs import JointAngles, Posture
from app.core.messages import ArmState
from app.core.types import ToolPose
from app.flow.following import posed


@final
class RecordedArm:
    """Goes from one of its recorded `states` to the next, evenly; `recorded_s`: the moment that is shown now [s].

    It was recorded about twice a second, so that where it moved fast it is known to a few centimetres alone; where it
    rested, exactly. Nothing moves it.
    """

    def __init__(self, states: Sequence[ArmState], recorded_s: Callable[[], float]) -> None:
        self._times_s = [state.time_s for state in states]
        self._postures = [Posture(joints=state.joints, tool=state.tool) for state in states]
        self._recorded_s = recorded_s

    def tool(self) -> ToolPose:
        """Pose and opening of the tool as the images have it now; from any thread."""
        return self._posture().tool

    def joints(self) -> JointAngles:
        """The joints' angles as the images have them now; from any thread."""
        return self._posture().joints

    def _posture(self) -> Posture:
        time_s = self._recorded_s()
        later = bisect_left(self._times_s, time_s)
        around = slice(max(later - 1, 0), later + 1)
        return posed(list(zip(self._times_s[around], self._postures[around], strict=True)), time_s)
