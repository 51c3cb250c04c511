"""A simulated cell on its own clock: arm, world and cameras of the running one, advanced by calls alone.

An action takes as long as the computer needs, and thinking time takes none of the world's: the same seed gives the same
episode, however busy the machine is.
"""

import math
from typing import Final, TypeAlias, final

import numpy as np
from jaxtyping import Float64

from app.arm.approvals import UsedApprovals
from app.arm.gate import begin
from app.config import Site
from app.core.dialogue.approval import Approved
from app.core.errors import MotionRefused
from app.core.geometry.scene_description import Stage
from app.core.geometry.track import Track
from app.core.messages import Executed, Frame, fresh_id
from app.core.rejection_codes import Refusal
from app.core.types import ToolPath, ToolPose
from app.rig.simulated.arm_control import ArmControl
from app.rig.simulated.cameras.simulated_cameras import SimulatedCameras
from app.rig.simulated.erring_arm import ErringArm
from app.rig.simulated.hidden_world import HiddenWorld
from app.rig.simulated.kinds import kind_of
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.world import Nodes

_LAID_S: Final = 1.0
"""Time for an object laid on the table to come to rest."""
_LONGEST_S: Final = 300.0
"""Longest motion: one that takes longer is stuck."""
_JOINED_S: Final = 0.5
"""Time in which a tip goes from where its last motion ended to where the next one begins, which errors may part."""
_END: Final = 0.5
"""The end of a session, as effects count its time."""
_ROUNDED: Final = 1e-6
"""Share of a period that is rounding."""


_Longer: TypeAlias = Float64[np.ndarray, "L 8"]
"""Poses of a tool that may come to rest later than others."""


@final
class LockStep:
    """Cell with the stage's object at `start (K, 3)` [m], the tool at home; `seed` is that of the cameras' noise.

    `hidden`: effects of its world, arm and cameras, and the world's physics. An arm that errs goes another way than it
    is told; `tool` and the commands of `Executed` are as it is told, its measurements as its encoders have it. What
    changes in the course of a session is as at its end.
    """

    def __init__(self, stage: Stage, start: Nodes, site: Site, seed: int, hidden: HiddenWorld | None = None) -> None:
        kind, effects = kind_of(stage), hidden.effects if hidden else ()
        home = kind.home(stage, start)
        self._site, self._arm, self._approvals = site, ArmControl(site, home), UsedApprovals()
        self._settle_s = max(site.timing.settle_s, stage.settle_s)
        self._errors, intrusion = ErringArm(effects), Intrusion(effects)
        intrusion.session = _END
        physics = hidden.physics if hidden else None
        self._world = kind.build(stage, start, 0.0, physics=physics, intrusion=intrusion)
        self._eyes, self._looks = SimulatedCameras(stage, effects, seed), 0
        self._tip = self._errors.goes(_at_rest(home), told_only=False).poses[0] if self._errors.errs else home
        self._world.place(self._tip)
        self._world.step(self._tip, _LAID_S)

    @property
    def tool(self) -> ToolPose:
        """Pose of the tool, as the arm is told."""
        return self._arm.measured

    @property
    def tip(self) -> ToolPose:
        """Ground truth: pose of the tool in the world."""
        return self._tip

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
        arm's limits do not allow the motion; with the arm moved, and the object not, where it does not come to an end.
        """
        self._approvals.use(approved)
        begin(self._arm, approved.motion, approved.digest, self._site)
        commanded, reached = self._drive()
        tips, measured = self._with_errors(reached)
        if self._errors.errs:
            self._step(tips[0], _JOINED_S)
        times = np.array([self._step(tip, self._site.timing.arm_period_s) for tip in tips[1:]])
        self._world.step(self._tip, self._settle_s)
        commanded, measured = commanded[np.minimum(np.arange(len(times)) + 1, len(commanded) - 1)], measured[1:]
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

    def _drive(self) -> tuple[ToolPath, ToolPath]:
        """Poses that the arm is told and reaches, one a period, until it is at rest, by drives without any error."""
        period, rows = self._site.timing.arm_period_s, [(self._arm.commanded.copy(), self._arm.measured.copy())]
        while self._arm.mode == "moving":
            self._arm.advance(period)
            rows.append((self._arm.commanded.copy(), self._arm.measured.copy()))
            if len(rows) * period > _LONGEST_S:
                raise MotionRefused(
                    Refusal.STUCK, f"The motion has not come to its end in {_LONGEST_S:.0f} s; it is stuck."
                )
        commanded, reached = (np.array(column) for column in zip(*rows, strict=True))
        return commanded, reached

    def _with_errors(self, reached: ToolPath) -> tuple[_Longer, _Longer]:
        """Poses of the tip, one a period from the first, and as the encoders have them, until the tip is at rest."""
        if not self._errors.errs:
            return reached, reached
        period = self._site.timing.arm_period_s
        told = Track(times_s=period * np.arange(len(reached)), poses=reached)
        made, measured = (self._errors.goes(told, told_only=told_only) for told_only in (False, True))
        at_s = period * np.arange(math.ceil(max(told.end_s, made.end_s) / period - _ROUNDED) + 1)
        return made.poses_at(at_s), measured.poses_at(at_s)

    def _step(self, tip: ToolPose, duration_s: float) -> float:
        """Move the tip straight there; the world's time then [s]."""
        self._world.step(tip, duration_s)
        self._tip = tip
        return self._world.time_s


def _at_rest(pose: ToolPose) -> Track:
    """Track of a tool that stays."""
    return Track(times_s=np.array([0.0, 1.0]), poses=np.stack([pose, pose]))
