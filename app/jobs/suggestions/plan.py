"""A motion that discovery asks for as a plan of one branch, simulated as any other."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float32

from app.arm.gate import refusal
from app.arm.timed_motion import made_track, motion_along
from app.config import Site
from app.core.errors import MotionRefused, PlanningError
from app.core.geometry.chamfer import chamfer_m2
from app.core.geometry.orientation import Orientation
from app.core.geometry.track import Track, upright
from app.core.messages import Branch, Model
from app.core.motion import Motion
from app.core.types import Centreline, Points, ToolPose
from app.jobs import jit_cache, rope_orientation
from app.jobs.apparatus_compensation import Correction, correction
from app.jobs.discovery_subject import subject_of
from app.jobs.suggestions.held import Held, begin_at, waits_for
from app.jobs.suggestions.strokes import aim_at, stroke_along
from app.planner.actions.actions import ActionSpace, Pushes
from app.planner.actions.carry_actions import Carries
from app.planner.actions.pour_actions import Pours
from app.planner.actions.sweep_actions import Sweeps
from app.planner.search.plan import Plan
from app.tasks import load

if TYPE_CHECKING:
    from app.sim.diagnosis.object_state import ObjectState
    from app.tasks.elements.base import Task

_FRAME_S = 0.1
"""Time between two places of the tool of a carry or a pour that is shown."""


def motion_of(track: Track, actions: ActionSpace, site: Site) -> Motion:
    """A recorded way of the tool as a motion, at its own speed where the site allows it.

    A carry or a pour goes on from its first pose. Raises PlanningError where the tool stands still.
    """
    if isinstance(actions, Carries | Pours):
        return motion_along(track, site)
    assert isinstance(actions, Pushes | Sweeps)
    return stroke_along(track, actions, site)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class SuggestedPlanner:
    """Planner of motions that discovery asks for, with a model whose errors of cameras and arm are allowed for.

    `goal` (M, 3) [m]: where the object shall be in the end; `tool`: its pose by the arm's own account, if known.
    """

    task: str
    model: Model
    goal: Points
    site: Site
    tool: ToolPose | None

    @cached_property
    def _correction(self) -> Correction | None:
        return correction(self.model) if self.model.apparatus else None

    def plan(self, asked: Motion, observed: Points, near: Centreline | None, orientation: Orientation) -> Plan | str:
        """The plan, or what a carry or a pour waits for (`jobs.worker_api.plan_of_suggestion`)."""
        task = load(self.task)
        if isinstance(task.actions, Carries | Pours):
            return self._held(task, task.actions, asked, observed)
        assert isinstance(task.actions, Pushes | Sweeps)
        x = self._correction.unproject(observed) if self._correction else observed
        made = aim_at(asked, x, task.actions, self.site)
        path = task.actions.measured_path(made.positions)
        phi = rope_orientation.oriented_phi(self.model, x, orientation, near)
        needed = jit_cache.needs(self.task, jit_cache.phi_of(self.model))
        simulate = jax.jit(jit_cache.action_simulator(self.task, len(x), *needed))
        before = task.initial_state(jnp.asarray(x)[None], None if near is None else jnp.asarray(near))
        end = simulate(jnp.asarray(phi)[None], before, jnp.asarray(path)[None])
        return self._plan(made, x, end, path[:, :3], path[None, :, :2].reshape(1, -1))

    def _held(self, task: "Task", actions: Held, asked: Motion, observed: Points) -> Plan | str:
        """The same of a motion of the tool that holds the object."""
        if self.tool is None:
            raise PlanningError("nobody knows where the tool is that holds the object.")
        allowed_for, here = self._correction, self.tool
        x = allowed_for.unproject(observed, here) if allowed_for else observed
        here = allowed_for.true_tool(here) if allowed_for else here
        if until := waits_for(here, x, actions):
            return until
        made = begin_at(asked, here, actions, subject_of(task).bowls)
        if isinstance(made, str):
            return made
        try:
            track = made_track(here, made, self.site)
        except MotionRefused as refused:
            raise PlanningError(str(refused)) from None
        end = _after(task, actions, x, jit_cache.phi_of(self.model), track)
        shown = track.at(np.arange(0.0, track.end_s + _FRAME_S, _FRAME_S)).astype(np.float32)
        return self._plan(made, x, end, shown, np.zeros((0, 0), np.float32))

    def _plan(
        self,
        made: Motion,
        x: Points,
        end: "ObjectState",
        way_m: Float32[np.ndarray, "W 3"],
        actions: Float32[np.ndarray, "L A"],
    ) -> Plan:
        """The plan of a simulated motion. Raises PlanningError where the arm's own process would refuse it."""
        predicted = np.asarray(end.x[0])
        if not np.isfinite(predicted).all():
            raise PlanningError("its simulation became non-finite; planning as usual.")
        motion = self._correction.command(made, x, predicted, self.site) if self._correction else made
        if refused := refusal(motion, self.site, self.tool):
            raise PlanningError(f"{refused} Planning as usual.")
        shown = self._correction.observe(predicted) if self._correction else predicted
        branch = Branch(
            origin="asked",
            actions=actions,
            tool_path=way_m,
            predicted=shown,
            final=shown,
            cost_before=float("nan"),
            cost_after=float("nan"),
            terms={},
            finite=True,
        )
        return Plan(
            branches=(branch,),
            best=0,
            motion=motion,
            predicted=shown,
            centreline=np.asarray(end.centreline[0]),
            chamfer_m2=float(chamfer_m2(x, self.goal)),
            predicted_chamfer_m2=float(chamfer_m2(predicted, self.goal)),
        )


def _after(task: "Task", actions: Held, x: Points, phi: Float32[np.ndarray, " P"], track: Track) -> "ObjectState":
    """The object after the tool has gone along the track in its own time, and rested as after an action.

    It is simulated in pieces of as many substeps as an action has, which is compiled once.
    """
    step_s = task.scene.dt_s * task.time_scale
    pieces = int(np.ceil((track.end_s / step_s + actions.rest_substeps) / actions.substeps))
    poses = track.poses_at(step_s * np.arange(pieces * actions.substeps + 1))
    path = np.concatenate([poses[:, :3], upright(poses[:, 3:7]), poses[:, 7:]], axis=1)
    path = jnp.asarray(path if isinstance(actions, Carries) else path[:, :7], jnp.float32)
    move = jax.jit(jit_cache.moving(task.name, len(x), *jit_cache.needs(task.name, phi)))
    began = jnp.asarray(x)[None]
    state = task.initial_state(began)
    for first in range(0, len(path) - 1, actions.substeps):
        state = move(jnp.asarray(phi)[None], state, path[None, first : first + actions.substeps + 1], began)
    return state
