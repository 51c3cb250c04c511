"""What a task is: data about a scene, an object, a tool and how to plan there. One file a task, named as the task."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, final

import numpy as np

from app.core.errors import UsageError
from app.core.messages import Proposal, fresh_id

if TYPE_CHECKING:  # Rigs need ropes and fingers alone: their processes shall not load JAX and Warp for these names.
    from jaxtyping import Float64

    from app.core.doubt import Verdict
    from app.core.messages import Goal, Model, Motion, Particles
    from app.core.types import Points
    from app.perception.reconstruct import Reconstruction
    from app.planner.actions import ActionSpace
    from app.planner.cost import Weights
    from app.planner.optimise import Descent
    from app.planner.plan import Plan
    from app.policy.base import Policy
    from app.sim.scene import Scene
    from app.tasks.curves import Problems


@final
@dataclass(frozen=True, kw_only=True)
class Rope:
    """A rope lying on the table. `colour` is its RGB albedo in 0..1."""

    length_m: float
    radius_m: float
    mass_kg: float
    colour: tuple[float, float, float]


@final
@dataclass(frozen=True, kw_only=True)
class Finger:
    """The closed two-finger gripper as a vertical capsule; `push_height_m` is its tip's height above the table."""

    radius_m: float
    push_height_m: float


@final
@dataclass(frozen=True, kw_only=True)
class Preset:
    """How much is computed for one decision: `branches` = k random ones + 1 of the policy, each `depth` actions."""

    branches: int
    depth: int
    particle_count: int
    gradient_steps: int


@final
@dataclass(frozen=True, kw_only=True)
class Task:
    """Everything about a task that is not the site's.

    `seeing`: how perception finds the object; its particle count is the preset's.
    `nominal`: parameters of the simulator, by name, whose nominal value for this task is not the simulator's own;
    `calibrated`: those that calibration estimates from transitions. `success_m2`: the Chamfer distance to the goal
    [m^2] at which the task is done. `haste`: real seconds in a simulated one.
    """

    name: str
    rope: Rope
    finger: Finger
    seeing: Reconstruction
    scene: Scene
    actions: ActionSpace
    policy: Policy
    weights: Weights
    descent: Descent
    problems: Problems
    nominal: Mapping[str, float]
    calibrated: tuple[str, ...]
    success_m2: float
    presets: Mapping[str, Preset]
    haste: float = 1.0

    def preset(self, name: str) -> Preset:
        """The preset called `name`. Raises UsageError with the known ones."""
        try:
            return self.presets[name]
        except KeyError:
            raise UsageError.unknown("preset", name, self.presets) from None

    def reconstruction(self, preset: str) -> Reconstruction:
        """How to see the object as so many particles as the preset plans with."""
        return replace(self.seeing, particle_count=self.preset(preset).particle_count)

    def start(self, seed: int) -> Float64[np.ndarray, "points 3"]:
        """Centreline of the rope at the start of episode `seed` [m]."""
        return self.problems.draw(seed, self.rope)[0]

    def goal(self, seed: int, particle_count: int) -> Points:
        """Where the rope shall be at the end of episode `seed`, as particles [m]."""
        from app.tasks.curves import fill_tube

        return fill_tube(self.problems.draw(seed, self.rope)[1], self.rope.radius_m, particle_count)


@final
@dataclass(frozen=True, kw_only=True)
class Wish:
    """What this episode is to do. `model` None starts from the task's nominal one.

    `goal` is in the true world frame; `shown_goal` is where cameras that err will show an object that is there, and
    None where they do not. `asked`: a push to offer before anything is planned; `verdict`: what a discovery concluded.
    """

    task: Task
    preset: str
    goal: Goal
    model: Model | None
    seed: int
    pushes: int
    automatic: bool
    calibrating: bool
    shown_goal: Points | None = None
    asked: Motion | None = None
    verdict: Verdict | None = None

    @property
    def target(self) -> Points:
        """What observations are compared with [m]."""
        return self.goal.positions if self.shown_goal is None else self.shown_goal

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
        )
