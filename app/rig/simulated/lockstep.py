"""A simulated cell on its own clock: arm, world and cameras of the running one, advanced by calls alone.

An action takes as long as the computer needs, and thinking time takes none of the world's: the same seed gives the same
episode, however busy the machine is.
"""

from typing import Final, final

import numpy as np

from app.arm.approvals import UsedApprovals
from app.arm.gate import begin
from app.config import Site
from app.core.dialogue.approval import Approved
from app.core.errors import MotionRefused
from app.core.geometry.scene_description import Stage
from app.core.messages import Executed, Frame, fresh_id
from app.core.rejection_codes import Refusal
from app.core.types import ToolPose
from app.rig.simulated.arm_control import ArmControl
from app.rig.simulated.cameras.simulated_cameras import SimulatedCameras
from app.rig.simulated.kinds import kind_of
from app.rig.simulated.worlds.world import Nodes

_LAID_S: Final = 1.0
"""Time for an object laid on the table to come to rest."""
_LONGEST_S: Final = 300.0
"""Longest motion: one that takes longer is stuck."""


@final
class LockStep:
    """Cell with the stage's object at `start (K, 3)` [m], the tool at home; `seed` is that of the cameras' noise."""

    def __init__(self, stage: Stage, start: Nodes, site: Site, seed: int) -> None:
        kind = kind_of(stage)
        home = kind.home(stage, start)
        self._site, self._arm, self._approvals = site, ArmControl(site, home), UsedApprovals()
        self._world = kind.build(stage, start, 0.0)
        self._eyes, self._looks = SimulatedCameras(stage, (), seed), 0
        self._world.place(home)
        self._world.step(home, _LAID_S)

    @property
    def tool(self) -> ToolPose:
        """Pose of the tool."""
        return self._arm.measured

    @property
    def time_s(self) -> float:
        """The world's own time [s]."""
        return self._world.time_s

    def nodes(self) -> Nodes:
        """Ground truth: the object's nodes in the world [m]."""
        return self._world.nodes()

    def look(self) -> list[Frame]:
        """Images of all cameras now."""
        self._looks += 1
        return self._eyes.look(self._world.snapshot(), stamp_s=self._world.time_s, number=self._looks)

    def execute(self, approved: Approved) -> Executed:
        """Execute the approved motion as the arm's own process would, and let the object come to rest.

        Raises MotionRefused, with nothing moved, where the approval is not genuine or was used before, and where the
        arm's limits do not allow the motion.
        """
        period, rows = self._site.timing.arm_period_s, list[tuple[float, ToolPose, ToolPose]]()
        self._approvals.use(approved)
        begin(self._arm, approved.motion, approved.digest, self._site)
        while self._arm.mode == "moving":
            self._arm.advance(period)
            self._world.step(self._arm.measured, period)
            rows.append((self._world.time_s, self._arm.commanded.copy(), self._arm.measured.copy()))
            if len(rows) * period > _LONGEST_S:
                raise MotionRefused(
                    Refusal.STUCK, f"The motion has not come to its end in {_LONGEST_S:.0f} s; it is stuck."
                )
        self._world.step(self._arm.measured, self._site.timing.settle_s)
        times, commanded, measured = (np.array(column) for column in zip(*rows, strict=True))
        return Executed(
            id=fresh_id("executed"),
            cause=(approved.id,),
            time_s=float(times[-1]),
            approved_id=approved.id,
            outcome="completed",
            reason="",
            times_s=times,
            commanded=commanded[:, :7],
            measured=measured[:, :7],
            openings=measured[:, 7],
        )
