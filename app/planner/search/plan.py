"""One decision, as in the paper: sample, roll out, descend, choose."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32, Int, PRNGKeyArray

from app.arm.gate import refusal
from app.core.errors import PlanningError
from app.core.geometry.chamfer import chamfer_m2
from app.core.messages import Branch, Origin
from app.core.motion import Motion
from app.core.types import Centreline, Points, ToolPose
from app.planner.search.optimise import Optimise, OptimizedRollouts, OptimizerConfig, Redraws, descend_from_cheapest
from app.planner.search.request import PlanRequest, Ways
from app.planner.search.rollout_frames import RolloutFrames, ShownRollout, grow, resimulate
from app.planner.search.tree import (
    Rollout,
    RootBatch,
    TreeConfig,
    continues,
    descended_count,
    first_of,
    own_branches,
    policy_shares,
    random_key,
    simulate,
    start,
    tool_pose,
)
from app.policy.base import PARKED_POSE, PlanningState

_AGAIN_M = 0.02
"""Distance of the ends of two tool paths within which a motion counts as one that was rejected."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """A decision: every branch of the tree, the index of the best, and the motion that executes its first action.

    `predicted (N, 3)`: the particles after that motion, `centreline`: a rope's nodes then; `chamfer_m2` of
    the observation and `predicted_chamfer_m2` of `predicted` to the goal [m^2]. `ahead`: it was made before the object
    was seen where it is.
    """

    branches: tuple[Branch, ...]
    best: int
    motion: Motion
    predicted: Points
    centreline: Centreline
    chamfer_m2: float
    predicted_chamfer_m2: float
    ahead: bool = False


@final
@dataclass(frozen=True, kw_only=True)
class TreePlanner:
    """The paper's planner. What is heavy are compiled functions of many branches at once: grow, descend, show anew.

    Descent begins from the cheapest branches, as many as `descended_count` says: in the decisions that were looked at
    hardly any other became the best (docs/results.md, "Descent from the cheaper half"). Before, random ones may be
    drawn anew ("Branches drawn anew"). `optimise`: another way to better all branches, instead.
    """

    search: TreeConfig
    descent: OptimizerConfig
    gradient_steps: int
    optimise: Optimise | None = None

    def __call__(self, request: PlanRequest) -> Plan:
        """Sample, roll out, descend, choose. Raises PlanningError where no branch stayed finite."""
        tree, goal = start(self.search, request), jnp.asarray(request.goal)
        grown = grow(self.search, tree, goal)
        decided = _descend(self, tree.phi, tree.now, goal, grown.rollout, random_key(request.seed))
        found, changed = jax.device_get(decided)
        seen = self._seen(tree, goal, grown, found.best, changed)
        return choose(self.search, found, self._origins(request), request, seen=seen)

    def compile(self, example: Points, phi: Float32[np.ndarray, " P"]) -> None:
        """Compile for states and goals of the size of `example` (N, 3): simulates the branches once, no descent."""
        tree, goal = start(self.search, PlanRequest(observed=example, goal=example, phi=phi)), jnp.asarray(example)
        grown = grow(self.search, tree, goal)
        descent = _descend.lower(self, tree.phi, tree.now, goal, grown.rollout, random_key(0))
        descent.compile()
        _, changed = descent.out_info
        if self.search.part is not None and changed.size:
            few, now, actions = first_of((tree.phi, tree.now, grown.rollout.actions), changed.size)
            resimulate.lower(self.search, few, now, goal, actions).compile()
        _ways(self.search, grown.rollout.actions[:, 0], PARKED_POSE)

    def _seen(
        self,
        tree: RootBatch,
        goal: Float[Array, "M 3"],
        grown: ShownRollout,
        best: Rollout,
        changed: Int[np.ndarray, " K"],
    ) -> RolloutFrames:
        """Moments of the branches; those that may have `changed` since they were sampled are simulated once more."""
        if self.search.part is None or not len(changed):
            return grown.moments
        phi, now = first_of((tree.phi, tree.now), len(changed))
        anew = resimulate(self.search, phi, now, goal, jnp.asarray(best.actions[changed])).moments
        return grown.moments.with_those(anew.ending_in(best.final[changed]), changed)

    def _origins(self, request: PlanRequest) -> Sequence[Origin]:
        """Origin of each branch's actions."""
        origins: list[Origin] = ["random"] * self.search.branches
        for branch in range(len(policy_shares(self.search))):
            origins[branch] = "part" if branch else self.search.origin
        if continues(self.search, request):
            origins[-1] = "continued"
        return origins


@partial(jax.jit, static_argnums=0)
def _descend(
    planner: TreePlanner,
    phi: Float[Array, "B P"],
    now: PlanningState,
    goal: Float[Array, "M 3"],
    sampled: Rollout,
    key: PRNGKeyArray,
) -> tuple[OptimizedRollouts, Int[Array, " K"]]:
    """The branches as they are decided between, and which of them may not be as they were sampled."""
    search, scale = planner.search, planner.search.space.scale()

    def evaluate(actions: Float[Array, "K D A"]) -> Rollout:
        few, here = first_of((phi, now), len(actions))
        return simulate(search, few, here, goal, actions)

    if planner.optimise is not None:
        return planner.optimise(evaluate, sampled.actions, scale), jnp.arange(search.branches)
    return descend_from_cheapest(
        evaluate,
        sampled,
        count=descended_count(search),
        steps=planner.gradient_steps,
        descent=planner.descent,
        scale=scale,
        redraws=Redraws(search.redraws, own_branches(search), key) if search.redraws else None,
    )


def choose(
    search: TreeConfig,
    found: OptimizedRollouts,
    origins: Sequence[Origin],
    request: PlanRequest,
    *,
    seen: RolloutFrames | None = None,
) -> Plan:
    """The cheapest branch that is finite, whose actions are feasible, and whose commanded motion the site allows.

    `origins` says of each branch found where its actions came from; `seen` is what the branches look like. Where it is
    not the only one, none whose first action is much like one that was rejected.
    Raises PlanningError where there is none.
    """
    site, tool, command = request.site, request.tool, request.command
    pose = tool_pose(request)
    told = tool if request.told_tool is None else request.told_tool
    ways = _ways(search, jnp.asarray(found.best.actions[:, 0]), pose)
    branches = tuple(_branch(search, found, ways[index], index, origin, seen) for index, origin in enumerate(origins))

    def commanded(index: int) -> Motion:
        motion = search.space.motion(branches[index].actions[0], pose, site)
        return motion if command is None else command(motion, request.observed, branches[index].predicted)

    order = _by_cost(found, branches, request.rejected)
    possible = ((index, motion) for index in order if not refusal(motion := commanded(index), site, told))
    chosen = next(possible, None)
    if chosen is None:
        raise PlanningError(
            f"Of {len(branches)} branches {int((~found.finite).sum())} became non-finite, {len(order)} "
            "leave the workspace, enter what is kept free or go further than the arm reaches, and the others start on "
            "top of the object; plan again "
            f"with another seed{'' if len(branches) > 1 else ' or with branches besides the policy'}, or move the "
            "object by hand."
        )
    best, motion = chosen
    predicted = branches[best].predicted
    return Plan(
        branches=branches,
        best=best,
        motion=motion,
        predicted=predicted,
        centreline=np.asarray(found.best.centreline[best]),
        chamfer_m2=float(chamfer_m2(request.observed, request.goal)),
        predicted_chamfer_m2=float(chamfer_m2(predicted, request.goal)),
    )


def _by_cost(found: OptimizedRollouts, branches: Sequence[Branch], rejected: Ways) -> list[int]:
    """Branches that are finite and feasible, the cheapest first; those like a rejected one after all others."""
    cost = np.asarray(found.best.cost)
    usable: list[int] = np.flatnonzero(np.asarray(found.finite & found.best.allowed)).tolist()
    return sorted(usable, key=lambda index: (_is_among(branches[index].tool_path, rejected), float(cost[index])))


def _is_among(way: Float32[np.ndarray, "W 3"], others: Ways) -> bool:
    ends = way[[0, -1]]
    return any(bool(np.linalg.norm(ends - other[[0, -1]], axis=1).max() < _AGAIN_M) for other in others)


def _ways(search: TreeConfig, actions: Float[Array, "B A"], tool: ToolPose) -> Float32[np.ndarray, "B T 3"]:
    """Tool paths [m] of all first actions at once: one by one, their transfers would take longer than all the rest."""
    there = jnp.tile(jnp.asarray(tool, jnp.float32), (len(actions), 1))
    return np.asarray(_tool_paths(search, actions, there))


@partial(jax.jit, static_argnums=0)
def _tool_paths(search: TreeConfig, actions: Float[Array, "B A"], tool: Float[Array, "B 8"]) -> Float[Array, "B T 3"]:
    return search.space.tool_path(actions, tool)[..., :3]


def _branch(
    search: TreeConfig,
    found: OptimizedRollouts,
    way: Float32[np.ndarray, "T 3"],
    index: int,
    origin: Origin,
    seen: RolloutFrames | None,
) -> Branch:
    best, weights = found.best, search.weights
    moments = {"frames": seen.frames[index], "tools": seen.tools[index]} if seen else {}
    return Branch(
        origin=origin,
        actions=np.asarray(best.actions[index]),
        tool_path=way,
        predicted=np.asarray(best.first[index]),
        final=np.asarray(best.final[index]),
        cost_before=float(found.cost_before[index]),
        cost_after=float(best.cost[index]),
        terms={
            "progress": weights.progress * float(best.terms.progress[index]),
            "contact": weights.contact * float(best.terms.contact[index]),
            **({"trespass": weights.trespass * float(best.terms.trespass[index])} if weights.has_bounds else {}),
            "last iterate": float(found.iterates[-1, index]),
            "lost gradients": float(found.lost_gradients[index]),
        },
        finite=bool(found.finite[index]),
        **moments,
    )
