"""Interface of a task: scene, object, tool and planning, as data. One file a task, named as the task."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol, TypeAlias, final

import numpy as np
from jaxtyping import Float64

from app.core.bounds import check_range
from app.core.errors import UsageError
from app.core.geometry.scene_description import Body, Rope, Stage
from app.core.geometry.shapes.tools import Finger
from app.core.messages import Proposal, fresh_id
from app.core.task_name import TaskName, recorded_name
from app.core.types import Points, ToolPose
from app.planner.method import DIPAC, Method

if TYPE_CHECKING:  # Whoever needs these names alone shall not load JAX and Warp for them.
    from jaxtyping import Array, Float

    from app.core.dialogue.model_monitor_messages import Verdict
    from app.core.messages import Episode, Goal, Model, Particles
    from app.core.motion import Motion
    from app.perception.reconstruct import Reconstruction
    from app.planner.actions.actions import ActionSpace
    from app.planner.search.cost import Weights
    from app.planner.search.optimise import OptimizerConfig
    from app.planner.search.plan import Plan
    from app.planner.search.tree import Begin
    from app.policy.base import Policy
    from app.policy.orthographic_views import OrthographicView
    from app.policy.symmetry import Symmetry
    from app.sim.model.scene import Scene
    from app.sim.parameter import ParameterSpec
    from app.sim.state import State
    from app.tasks.elements.rods import RodDynamics
    from app.tasks.elements.success import SuccessCriterion


_AROUND_M, _PIXEL_M = 0.04, 0.008
"""Margin [m] of pictures around the reach of actions, and their pixel [m]: half of a rope's width."""
_ROUNDED = 1e-6
"""Relative rounding error of a number in single precision."""
_LEAST_SPREAD = 1e-3
"""Spread [scale of actions] below which nothing is drawn anew, and share of an action below which it is none."""
_LONGEST, _LARGEST_TIME_SCALE, _MOST = 1e3, 1e2, 1e6
"""Upper bounds on actions, time scale and sizes of presets: a larger number is a mistake."""


@final
@dataclass(frozen=True, kw_only=True)
class Preset:
    """Size of the search for one decision: `branches`, one of them the policy's, of `depth` actions each.

    `descended`, `redraws`, `policy_shares`: see `TreeConfig`.
    """

    branches: int
    depth: int
    particle_count: int
    gradient_steps: int
    descended: int | None = None
    redraws: tuple[float, ...] = ()
    policy_shares: tuple[float, ...] = ()

    @property
    def numbers(self) -> Mapping[str, int]:
        """The counts that it says, by name."""
        return {name: each for name, each in vars(self).items() if isinstance(each, int)}


Nodes: TypeAlias = Float64[np.ndarray, "K 3"]
"""Nodes [m] of the object in a simulated world: a rope's centreline, or the centres of many pieces."""


def _at_rest(x: Float[Array, "B N 3"], near: Float[Array, "2 n"] | None = None) -> State:
    """Particles at rest and undeformed."""
    from app.planner.search.tree import at_rest

    return at_rest(x, near)


class ProblemSampler(Protocol):
    """Initial and goal configurations of the object, by seed."""

    def start(self, seed: int) -> Nodes:
        """The object at the start."""
        ...

    def goal(self, seed: int, particle_count: int) -> Points:
        """Goal of the object, as particles [m]."""
        ...

    def particles(self, nodes: Nodes, particle_count: int) -> Points:
        """A world's object as evenly spread particles [m]."""
        ...


@final
@dataclass(frozen=True, kw_only=True)
class TrainingVariant:
    """Another object, and the problems with it, that demonstrations of a task are about."""

    stage: Stage
    problems: ProblemSampler


@final
@dataclass(frozen=True, kw_only=True)
class Task:
    """Everything about a task that does not depend on the site.

    `perception`: settings of the reconstruction; its particle count is the preset's. `initial_state`: the simulator's
    state of an observed object; `at_rest`: actions end at rest, so that the next one depends on the object's position
    alone. `symmetry`: isometries by which demonstrations generalise; `side_view`: a view for policies that look,
    besides that from above.
    `nominal`: parameters of the simulator, by name, whose nominal value for this task is not the simulator's own;
    `calibrated`: those that calibration estimates from transitions. `success`: the criterion on the true object;
    `stop_when`: that on observations, if it has to be stricter; `horizon`: the actions after which an evaluation ends
    otherwise. `rods`: the object as a rod, if it is a rope; `dynamics`: see `with_dynamics`; `own_dynamics`: the
    default of commands. `sized`: the task with another rope and finger; `with_body`: with another object of its kind;
    `hard`: with its hard problems.
    `time_scale`: real seconds in a simulated one. `open_gripper_m`: a tool that opens less may hold the object, which
    is not done then, wherever it is. `training_variant`: the setting of demonstrations, if it has another object; a
    model that they calibrate has to go on learning in use.
    """

    name: str
    stage: Stage
    perception: Reconstruction
    scene: Scene
    actions: ActionSpace
    policy: Policy
    symmetry: Symmetry
    weights: Weights
    descent: OptimizerConfig
    problems: ProblemSampler
    nominal: Mapping[str, float]
    calibrated: tuple[str, ...]
    success: SuccessCriterion
    horizon: int
    presets: Mapping[str, Preset]
    time_scale: float = 1.0
    initial_state: Begin = _at_rest
    at_rest: bool = True
    stop_when: SuccessCriterion | None = None
    open_gripper_m: float = 0.0
    side_view: OrthographicView | None = None
    training_variant: TrainingVariant | None = None
    rods: RodDynamics | None = None
    dynamics: str = "mpm"
    own_dynamics: str = "mpm"
    sized: Callable[[Rope, Finger], Task] | None = None
    with_body: Callable[[Body], Task] | None = None
    hard: Callable[[Task], Task] | None = None

    def parameters(self, *, stiff: bool | None = None) -> tuple[ParameterSpec, ...]:
        """The columns of phi, as far as its simulators bear them.

        `stiff`: of rods, those that the simulator of `rods.scene` bears (False), or that of `rods.stiff_scene` is for
        (True): the ranges of stiffness of the two adjoin. Where one simulates all, so does its range.
        """
        from app.sim.model.params import PARAMETERS, ROD_PARAMETERS, with_stiffness_between, with_stiffness_up_to

        if self.dynamics != "rods" or self.rods is None:
            return with_stiffness_up_to(PARAMETERS, self.scene.stiffest_pa)
        usual, most = (
            (1 - _ROUNDED) * scene.max_rigidity_n_m2 / scene.second_moment_m4
            for scene in (self.rods.scene, self.rods.stiff_scene)
        )
        above = usual * (1 + 2 * _ROUNDED)
        if stiff and above < most:
            return with_stiffness_between(ROD_PARAMETERS, above, most)
        return with_stiffness_up_to(ROD_PARAMETERS, most if stiff is None else usual)

    @property
    def recorded_name(self) -> str:
        """Its name in recordings: without its dynamics."""
        return recorded_name(self.name)

    @property
    def problem(self) -> str:
        """The name of its file, whatever its sizes and dynamics."""
        return TaskName.parse(self.name).problem

    def with_dynamics(self, dynamics: str) -> Task:
        """The same task, its object simulated by another engine: "mpm" (material points) or "rods".

        It is called TASK@rods (`TaskName`), as its models are others. Raises UsageError where its object is no rope.
        """
        from app.planner.actions.actions import Pushes
        from app.sim.rods.state import RodStart

        known = ["mpm"] if self.rods is None else ["mpm", "rods"]
        if dynamics not in known:
            raise UsageError.unknown(f"dynamics of {self.name}", dynamics, known)
        if dynamics == "mpm" or self.rods is None:
            return self
        assert isinstance(self.actions, Pushes)
        steps = {"push_substeps": self.rods.push_substeps, "rest_substeps": self.rods.rest_substeps}
        return replace(
            self,
            name=f"{self.name}@rods",
            dynamics="rods",
            actions=replace(self.actions, **steps),
            nominal=self.rods.nominal,
            calibrated=self.rods.calibrated,
            presets=self.rods.presets,
            initial_state=RodStart.of(self.rods.scene),
            time_scale=1.0,
        )

    @property
    def demonstration_task(self) -> Task:
        """The task that the expert demonstrates: itself, or its training variant."""
        if self.training_variant is None:
            return self
        return replace(
            self, stage=self.training_variant.stage, problems=self.training_variant.problems, training_variant=None
        )

    def __post_init__(self) -> None:
        """Raises ParameterError, which names the field and the value, where a number or a name cannot be."""
        from app.sim.model.params import index

        specs = self.parameters()
        for name, value in self.nominal.items():
            spec = specs[index(name)]
            check_range(f"nominal {name}", value, spec.low, spec.high)
        for name in self.calibrated:
            index(name)
        check_range("horizon", float(self.horizon), 1.0, _LONGEST)
        check_range("time_scale", self.time_scale, 1 / _LARGEST_TIME_SCALE, _LARGEST_TIME_SCALE)
        for kind, preset in self.presets.items():
            for name, value in preset.numbers.items():
                check_range(f"presets[{kind!r}].{name}", float(value), float(name != "gradient_steps"), _MOST)
            for spread in preset.redraws:
                check_range(f"presets[{kind!r}].redraws", spread, _LEAST_SPREAD, _MOST)
            for share in preset.policy_shares:
                check_range(f"presets[{kind!r}].policy_shares", share, _LEAST_SPREAD, 1.0)
            most = max(preset.branches - 2, 0) if self.actions.divisible else 0
            check_range(
                f"presets[{kind!r}], number of policy_shares", float(len(preset.policy_shares)), 0.0, float(most)
            )

    @property
    def views(self) -> tuple[OrthographicView, ...]:
        """Views of policies that look: the whole reach of actions from above, and from the side if the task has one."""
        from app.policy.orthographic_views import OrthographicView

        (x0, y0, z0), (x1, y1, z1) = self.actions.reach
        if self.symmetry.turns and not any(self.symmetry.shift_m):
            # All of the reach is turned about one place, so that its longer side may come to lie either way.
            (x, y), half = self.symmetry.about_m, max(x1 - x0, y1 - y0) / 2
            x0, y0, x1, y1 = x - half, y - half, x + half, y + half
        around = ((x0 - _AROUND_M, y0 - _AROUND_M, z0), (x1 + _AROUND_M, y1 + _AROUND_M, z1))
        top = OrthographicView(low=around[0], high=around[1], pixel_m=_PIXEL_M)
        return (top,) if self.side_view is None else (top, self.side_view)

    @property
    def rope(self) -> Rope:
        """The object, where it is a rope. Raises UsageError where it is not."""
        if not isinstance(self.stage.body, Rope):
            raise UsageError(f"{self.name} is about a {type(self.stage.body).__name__}; this works for ropes so far.")
        return self.stage.body

    @property
    def finger(self) -> Finger:
        """The tool, where it is a finger. Raises UsageError where it is not."""
        if not isinstance(self.stage.tool, Finger):
            raise UsageError(f"{self.name} uses a {type(self.stage.tool).__name__}; this works for fingers so far.")
        return self.stage.tool

    def preset(self, name: str) -> Preset:
        """The preset called `name`. Raises UsageError with the known ones."""
        try:
            return self.presets[name]
        except KeyError:
            raise UsageError.unknown("preset", name, self.presets) from None

    def reconstruction(self, preset: str) -> Reconstruction:
        """Settings of the reconstruction, with the preset's number of particles."""
        return replace(self.perception, particle_count=self.preset(preset).particle_count)

    def start(self, seed: int) -> Nodes:
        """The object at the start of episode `seed`, as the nodes of a simulated world [m]."""
        return self.problems.start(seed)

    def goal(self, seed: int, particle_count: int) -> Points:
        """Goal of the object in episode `seed`, as particles [m]."""
        return self.problems.goal(seed, particle_count)

    def particles(self, nodes: Nodes, particle_count: int) -> Points:
        """The object of a simulated world as perfect cameras would see it, as particles [m]."""
        return self.problems.particles(nodes, particle_count)

    def is_done(self, x: Points, goal: Points, tool: ToolPose) -> bool:
        """True if an object that truly is at `x` (N, 3) [m] meets the criterion and stays there without the tool."""
        return self._empty(tool) and self.success.is_reached(x, goal)

    def has_ended(self, seen: Points, goal: Points, tool: ToolPose | None = None) -> bool:
        """True if an object observed at `seen` (N, 3) [m], with the tool there, needs no further action."""
        return self._empty(tool) and (self.stop_when or self.success).is_reached(seen, goal)

    def _empty(self, tool: ToolPose | None) -> bool:
        """True if the tool surely holds nothing, as one that is nowhere near."""
        return tool is None or bool(tool[7] >= self.open_gripper_m)


@final
@dataclass(frozen=True, kw_only=True)
class Experiment:
    """Pushes that are chosen for their information about errors of the model, instead of plans for a goal.

    At most `budget` of them; after each `batch`, an episode of the recording, all causes are weighed anew.
    """

    budget: int
    batch: int = 4


@final
@dataclass(frozen=True, kw_only=True)
class EpisodeConfig:
    """Configuration of an episode. `model` None starts from the task's nominal one; `method`: how it is decided.

    `goal` is in the true world frame; `shown_goal` is its image in the frame of cameras that err, None if they do not.
    `asked`: pushes to propose before anything is planned; `experiment`: further pushes are chosen for their information
    and the goal does not matter; `opening`: the first message of the session's recording; `verdict`: the conclusion of
    a discovery.
    `staying`: the program goes on after the goal is reached, the `pushes` are made or something fails, and waits for
    requests until it is ended. `answering`: observations respond to the arm's motion; otherwise, as in a recording,
    nothing is learned from them. `checklist`: nothing moves before one is complete, as on every real arm;
    `allow_automatic`: there, too, motions may be made without approval once that is confirmed.
    """

    task: Task
    preset: str
    goal: Goal
    model: Model | None
    seed: int
    pushes: int
    automatic: bool
    calibrating: bool
    method: Method = DIPAC
    shown_goal: Points | None = None
    asked: tuple[Motion, ...] = ()
    experiment: Experiment | None = None
    opening: Episode | None = None
    verdict: Verdict | None = None
    staying: bool = False
    answering: bool = True
    checklist: bool = False
    allow_automatic: bool = False

    @property
    def target(self) -> Points:
        """Goal in the frame of the observations [m]."""
        return self.goal.positions if self.shown_goal is None else self.shown_goal

    def is_reached(self, particles: Particles, tool: ToolPose) -> bool:
        """True if the task is done, by the observation and the tool's pose."""
        return self.task.has_ended(particles.positions, self.target, tool)

    def proposal(self, plan: Plan, observed: Particles, model: Model, *, began_s: float, now_s: float) -> Proposal:
        """`plan`, made for `observed` with `model` from `began_s` to `now_s` [s], as an offer to the operator."""
        return Proposal(
            id=fresh_id("proposal"),
            cause=(observed.id, self.goal.id, model.id),
            time_s=now_s,
            task=self.task.name,
            particles_id=observed.id,
            goal_id=self.goal.id,
            model_id=model.id,
            model_version=model.version,
            observed=observed.positions,
            branches=plan.branches,
            best=plan.best,
            motion=plan.motion,
            chamfer_m2=plan.chamfer_m2,
            predicted_chamfer_m2=plan.predicted_chamfer_m2,
            plan_s=now_s - began_s,
            ahead=plan.ahead,
        )
