"""Motions that an operator asks for: the way to the start pose, and those of a demonstration, as proposals.

They are shown, approved and checked as any plan is; the arm's process does not tell them apart.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, final

import numpy as np

from app.arm.gate import check_motion, way
from app.arm.path import SCALE, at_travel_height
from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.approval import drift
from app.core.dialogue.requests import DemonstrationRequest, StartPoseRequest
from app.core.errors import DipacError, PlanningError, RecordingError
from app.core.geometry.chamfer import chamfer_m2
from app.core.geometry.track import corner_indices
from app.core.messages import Branch, Executed, Model, Origin, Particles, Proposal, Transition, fresh_id
from app.core.motion import Motion
from app.core.ports import Arm, Clock, Computer, Studio
from app.core.types import Points, ToolPath, ToolPose
from app.jobs.shown_motion import predict_motion
from app.session.state import MotionsRequest, RequestedMotions
from app.tasks.elements.base import EpisodeConfig

_MM: Final = 1e3
_SAME_M: Final = 1e-3
_TURNED: Final = 1e-6
"""One minus the cosine of half an angle, a sixth of a degree, within which orientations are the same."""
_TOUCH_M: Final = 0.05
_ABOVE_M: Final = 0.02
"""A pose this near to the object, over the table, and not this far above it, is not gone down to: half a hand's width,
and six times what perception errs by."""
_CORNER_M: Final = 5e-4
"""Farthest that a demonstrated path is left by the lines between its corners; an arm errs by twice that."""
_STILL_M: Final = 1e-5
"""A tool that moves less from one sample to the next stands."""
_SLOWEST_M_S: Final = 0.01
_APPROACH_M_S: Final = 0.10
_PERIOD_S: Final = 0.02
"""Time from the end of one motion to the beginning of the next where both are made as one."""
_JOINED_M: Final = 0.004
"""A motion that begins as near to where the tool is continues the one before: less than the arm's process allows."""


@final
class RequestedMotionProposals:
    """Proposals of requested motions. `start`: pose of the tool as the session began."""

    def __init__(
        self, site: Site, arm: Arm, planner: Computer, studio: Studio | None, announcer: MessageBus, clock: Clock
    ) -> None:
        self.start = arm.tool()
        self._site, self._arm, self._planner, self._studio = site, arm, planner, studio
        self._announcer, self._clock = announcer, clock

    async def on_request(
        self, request: StartPoseRequest | DemonstrationRequest, config: EpisodeConfig, observed: Particles | None
    ) -> MotionsRequest | None:
        """The event of a request that can be fulfilled from here; None, which is announced, of any other."""
        try:
            if isinstance(request, StartPoseRequest):
                way_to(self.start, self._arm.tool(), observed.positions if observed else None, self._site)
                return MotionsRequest(RequestedMotions(request.operator), request.id)
            return await self._demonstration(request, config, observed)
        except DipacError as error:
            self._announcer.notice("motion", f"Nothing is offered for what you asked for. {error}", request.id)
            return None

    async def proposal(
        self, requested: RequestedMotions, config: EpisodeConfig, observed: Particles, model: Model
    ) -> Proposal | None:
        """The next of these motions for the object where it is; None, which is announced, where it fits no more."""
        began_s = self._clock.now()
        try:
            if not requested.demonstration:
                motion = way_to(self.start, self._arm.tool(), observed.positions, self._site)
                return self._propose("start", config, observed, model, motion, observed.positions, began_s)
            shown = requested.demonstration[0]
            require_same_scene(shown.before, observed.positions, self._site.timing.plan_max_drift_m)
            motion = demonstrated_motion(shown.executed, self._arm.tool(), self._site)
            self._check(motion)
            predicted = await self._planner.run(
                predict_motion, config.task.name, observed.positions, model, shown.executed.tool
            )
            return self._propose("shown", config, observed, model, motion, predicted, began_s)
        except DipacError as error:
            self._announcer.notice("motion", f"What you asked for ends here. {error}")
            return None

    async def _demonstration(
        self, request: DemonstrationRequest, config: EpisodeConfig, observed: Particles | None
    ) -> MotionsRequest:
        """The motions of the demonstration. Raises DipacError, in words, where they cannot be made from here."""
        if self._studio is None:
            raise RecordingError("This session is not recorded, so that it has no folder of demonstrations.")
        if observed is None:
            raise PlanningError("The object has not been seen yet; look at the cameras.")
        task, transitions = await self._studio.demonstration(request.recording)
        if task != config.task.recorded_name:
            raise RecordingError(f"{request.recording} is of {task}, and this session of {config.task.recorded_name}.")
        whole = tuple(each for each in transitions if each.executed.outcome == "completed")
        if not whole:
            raise RecordingError(f"{request.recording} holds no motion that was made to its end.")
        require_same_scene(whole[0].before, observed.positions, self._site.timing.plan_max_drift_m)
        return MotionsRequest(RequestedMotions(request.operator, join_motions(whole, self._site)), request.id)

    def _check(self, motion: Motion) -> None:
        """Raises MotionRefused where the arm's process would refuse the motion from where the tool is."""
        check_motion(motion, motion.digest(), self._site)
        way(self._arm.tool(), motion, self._site)

    def _propose(
        self,
        origin: Origin,
        config: EpisodeConfig,
        observed: Particles,
        model: Model,
        motion: Motion,
        predicted: Points,
        began_s: float,
    ) -> Proposal:
        now_s, x, goal = self._clock.now(), observed.positions, config.target
        branch = Branch(
            origin=origin,
            actions=np.zeros((0, 0), np.float32),
            tool_path=motion.positions.astype(np.float32),
            predicted=predicted,
            final=predicted,
            cost_before=float("nan"),
            cost_after=float("nan"),
            terms={},
            finite=True,
        )
        return self._announcer.say(
            Proposal(
                id=fresh_id("proposal"),
                cause=(observed.id, config.goal.id, model.id),
                time_s=now_s,
                task=config.task.name,
                particles_id=observed.id,
                goal_id=config.goal.id,
                model_id=model.id,
                model_version=model.version,
                observed=x,
                branches=(branch,),
                best=0,
                motion=motion,
                chamfer_m2=float(chamfer_m2(x, goal)),
                predicted_chamfer_m2=float(chamfer_m2(predicted, goal)),
                plan_s=now_s - began_s,
            )
        )


def way_to(start: ToolPose, tool: ToolPose, x: Points | None, site: Site) -> Motion:
    """The way of the `tool` up, across and down to the pose `start`; the fingers stay as they are.

    Raises PlanningError where it is there already, or the object `x` (N, 3) [m] lies there, and MotionRefused where the
    arm's process would refuse it.
    """
    end = np.array([*start[:7], tool[7]])
    turned = 1 - abs(float(end[3:7] @ tool[3:7]))  # A quaternion and its negative are one orientation.
    if np.linalg.norm((end - tool)[:3]) < _SAME_M and turned < _TURNED:
        raise PlanningError("The tool is at the start pose.")
    if x is not None and len(x):
        near = x[np.linalg.norm(x[:, :2] - start[:2], axis=1) < _TOUCH_M]
        if len(near) and start[2] < near[:, 2].max() + _ABOVE_M:
            raise PlanningError("The object lies at the start pose; move it away, or go there by hand.")
    poses = np.stack([tool, at_travel_height(tool, site), at_travel_height(end, site), end])
    motion = _as_motion(poses, np.full(len(poses), min(2 * _APPROACH_M_S, site.limits.speed_m_s)), continues=True)
    check_motion(motion, motion.digest(), site)
    way(tool, motion, site)
    return motion


def require_same_scene(shown: Points, observed: Points, most_m: float) -> None:
    """Raises PlanningError where an object `observed` (N, 3) [m] lies otherwise than the `shown` one (M, 3) [m]."""
    apart_m = drift(shown, observed)
    if not apart_m <= most_m:
        middle = _MM * (observed.mean(axis=0) - shown.mean(axis=0))[:2]
        raise PlanningError(
            f"The object lies {_MM * apart_m:.0f} mm from where it lay in the demonstration (limit "
            f"{_MM * most_m:.0f} mm; its middle {middle[0]:+.0f} mm along x, {middle[1]:+.0f} mm along y): lay it as "
            "it was shown, or show it anew."
        )


def join_motions(motions: Sequence[Transition], site: Site) -> tuple[Transition, ...]:
    """The motions, those as one that begin where the tool was left below the travel height, at or in the object."""
    made = list[Transition]()
    for each in motions:
        if made and _goes_on(made[-1].executed, each.executed, site):
            whole = _one_after_the_other(made[-1].executed, each.executed)
            made[-1] = replace(made[-1], executed=whole, after=each.after)
        else:
            made.append(each)
    return tuple(made)


def _goes_on(first: Executed, second: Executed, site: Site) -> bool:
    """True if the second begins where the first ended, which is no place that motions go away to."""
    end, begin = first.commanded[-1, :3], second.commanded[0, :3]
    return bool(np.linalg.norm(begin - end) < _JOINED_M and end[2] < site.travel_height_m - _ABOVE_M)


def _one_after_the_other(first: Executed, second: Executed) -> Executed:
    """Both motions as one, without the pause between them."""
    pause_s = second.times_s[0] - first.times_s[-1] - _PERIOD_S
    if not len(first.measured) or not len(second.measured):
        first, second = replace(first, measured=first.measured[:0]), replace(second, measured=second.measured[:0])
    return replace(
        first,
        times_s=np.concatenate([first.times_s, second.times_s - pause_s]),
        commanded=np.concatenate([first.commanded, second.commanded]),
        measured=np.concatenate([first.measured, second.measured]),
        openings=np.concatenate([first.tool[:, 7], second.tool[:, 7]]),
    )


def demonstrated_motion(executed: Executed, tool: ToolPose, site: Site) -> Motion:
    """A motion that was made, as one to be made again: its corners, at the speeds that it had and the site allows.

    Where it begins at the `tool`, it continues from there; any other is approached by way of the travel height, and
    lifted to it at its end. What a hand held from one motion to the next is therefore joined before (`join_motions`).
    """
    poses = np.concatenate([executed.commanded, executed.tool[:, 7:]], axis=1)
    kept = corner_indices(poses * SCALE, _CORNER_M)
    steps = np.linalg.norm(np.diff(poses * SCALE, axis=0), axis=1)
    lasting_s = np.where(steps > _STILL_M, np.diff(executed.times_s), 0.0)
    arc, moving_s = (np.concatenate([[0.0], np.cumsum(each)])[kept] for each in (steps, lasting_s))
    speeds = np.diff(arc) / np.maximum(np.diff(moving_s), 1e-9)
    speeds = np.concatenate([[_APPROACH_M_S], speeds])
    continues = bool(np.linalg.norm(poses[0, :3] - tool[:3]) < _JOINED_M)
    return _as_motion(poses[kept], np.clip(speeds, _SLOWEST_M_S, site.limits.speed_m_s), continues=continues)


def _as_motion(poses: ToolPath, speeds: np.ndarray, *, continues: bool) -> Motion:
    turns = poses[:, 3:7] / np.linalg.norm(poses[:, 3:7], axis=1, keepdims=True)
    return Motion(positions=poses[:, :3], speeds=speeds, turns=turns, openings=poses[:, 7], continues=continues)
