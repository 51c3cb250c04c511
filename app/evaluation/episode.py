"""One episode in lock step, by the loop of the running application."""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, NamedTuple, TypeAlias, final

import numpy as np

from app.config import Site
from app.core.dialogue.approval import Approved, automatic_decision
from app.core.errors import DipacError, PlanningError
from app.core.geometry.chamfer import chamfer_m2
from app.core.geometry.orientation import UNKNOWN
from app.core.messages import Branch, Decision, Executed, Frame, Goal, Model, Particles, Proposal, Transition, fresh_id
from app.core.types import Centreline, Points, ToolPose
from app.evaluation.pour_view import seen_pour
from app.jobs import worker_api
from app.perception.reconstruct import reconstruct
from app.planner.method import Method
from app.planner.search.plan import Plan
from app.planner.search.request import Ahead, remainder_of
from app.rig.simulated.hidden_world import HiddenWorld
from app.rig.simulated.lockstep import LockStep
from app.session.approving import approval_gate
from app.session.loop import complete, go_round
from app.tasks.elements.base import EpisodeConfig, Task

Eyes: TypeAlias = Literal["cameras", "truth"]
"""Rendered images that perception makes particles of; or the truth, spread as evenly and with the noise of that."""

NOISE_M = 0.0015
"""Standard deviation of simulated particles about the truth: that of particles from images (docs/results.md)."""
_ATTEMPTS = 3
"""A planner whose branches all fail draws others; the third failure in a row ends the episode."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class EvaluationConfig:
    """Configuration of an episode. `online`: the model learns from every action; `actions` at most, the task's horizon.

    `play_on`: all actions are made, even after the goal is observed to be reached, so that all methods make as many.
    `otherwise`: the fallback if `method` finds no feasible action; None: `method` again. `hidden`: what is hidden in
    the cell. `ahead`: as by a planner that is quicker than the arm, the next motion is planned while one is made, for
    where the object is predicted to lie, and taken where that holds; no decision counts the time of that.
    """

    task: Task
    preset: str
    seed: int
    method: Method
    model: Model
    online: bool = False
    eyes: Eyes = "cameras"
    actions: int | None = None
    play_on: bool = False
    otherwise: Method | None = None
    hidden: HiddenWorld | None = None
    ahead: bool = False

    @cached_property
    def episode(self) -> EpisodeConfig:
        """Configuration of the running application for the same episode."""
        task = self.task
        goal = task.goal(self.seed, task.preset(self.preset).particle_count)
        return EpisodeConfig(
            task=task,
            preset=self.preset,
            goal=Goal(id=fresh_id("goal"), time_s=0.0, positions=goal),
            model=self.model,
            seed=self.seed,
            pushes=task.horizon if self.actions is None else self.actions,
            automatic=True,
            calibrating=self.online,
            method=self.method,
        )


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class EpisodeStep:
    """One action: what was seen, planned, approved and made, and what was seen then. `frames` are those of `before`."""

    frames: Sequence[Frame]
    before: Particles
    plan: Plan
    proposal: Proposal
    decision: Decision
    approved: Approved
    transition: Transition
    after: Particles
    model: Model


@final
@dataclass(kw_only=True, eq=False)
class EpisodeResults:
    """Results of an episode so far. Distances, shares and successes are of the truth, initially and after each action.

    `ahead`: True for each action that was planned ahead. `done`: number of actions after which the object was first
    observed at the goal, which is when an operator would stop; None if it never was. `failure`: the reason of an early
    end, in words.
    """

    chamfer_m2: list[float] = field(default_factory=list[float])
    share: list[float] = field(default_factory=list[float])
    reached: list[bool] = field(default_factory=list[bool])
    decision_s: list[float] = field(default_factory=list[float])
    ahead: list[bool] = field(default_factory=list[bool])
    models: list[Model] = field(default_factory=list[Model])
    done: int | None = None
    failure: str = ""

    @property
    def success(self) -> bool:
        """True if the object truly was at the goal when it was observed there, or else at the end."""
        if self.done is not None:
            return self.reached[self.done]
        return not self.failure and bool(self.reached) and self.reached[-1]


Listener: TypeAlias = Callable[[EpisodeStep], None]


def play(order: EvaluationConfig, listen: Listener | None = None, site: Site | None = None) -> EpisodeResults:
    """Play until the object is seen where it shall be, the actions are used up, or something fails."""
    stages = _LockStepStages(order, site or Site(), listen)
    try:
        complete(stages.run())
    except DipacError as error:
        stages.played.failure = str(error)
    return stages.played


class _Offer(NamedTuple):
    """Plan, and what of it is shown for approval."""

    plan: Plan
    proposal: Proposal


class _Approval(NamedTuple):
    """Decision on an offer, and leave to make its motion."""

    offer: _Offer
    decision: Decision
    approved: Approved


class _Made(NamedTuple):
    """Approval, and the motion as it was made."""

    approval: _Approval
    executed: Executed


@final
class _LockStepStages:
    """Stages of the loop in a cell that stands still while a method thinks; and the method's knowledge of the cell.

    `played`: the results so far, even after a failure.
    """

    def __init__(self, order: EvaluationConfig, site: Site, listen: Listener | None) -> None:
        self._order, self._site, self._task = order, site, order.task
        self._count = order.task.preset(order.preset).particle_count
        self._gate = approval_gate(site.timing)
        self._cell = LockStep(order.task.stage, order.task.start(order.seed), site, order.seed, order.hidden)
        self._goal, self._model = order.episode.target, order.model
        self._method, self._listen = order.method, listen
        self._rng, self._learnt = np.random.default_rng([order.seed, 1]), list[Transition]()
        self._frames: Sequence[Frame] = ()
        self._near: Centreline | None = None
        self._last: tuple[Branch, Points] | None = None
        self._ahead: Ahead | None = None
        self._orientation = UNKNOWN
        self.played, self._over = EpisodeResults(), False

    async def run(self) -> None:
        """Go round until it is over. Raises the DipacError that ends it before."""
        self._judge()
        self._seen = self._see()
        while not self._over:
            await go_round(self)

    async def observe(self) -> Particles | None:
        """The object as it was seen last; None where it is at the goal, or the actions are used up."""
        played, limit = self.played, self._order.episode.pushes
        if played.done is None and self._has_ended(self._cell.tool):
            played.done = len(played.decision_s)
        at_goal = played.done is not None and not self._order.play_on
        self._over = at_goal or len(played.decision_s) >= limit
        return None if self._over else self._seen

    async def plan(self, observed: Particles) -> _Offer:
        """The method's plan, as it is offered. Raises PlanningError where it finds none."""
        began_s = time.perf_counter()
        plan = self._plan(observed.positions, len(self.played.decision_s))
        self.played.decision_s.append(time.perf_counter() - began_s)
        self.played.ahead.append(plan.ahead)
        self._remember(observed.positions)
        now_s = self._cell.time_s  # Planning takes none of the world's time.
        return _Offer(plan, self._order.episode.proposal(plan, observed, self._model, began_s=now_s, now_s=now_s))

    async def approve(self, plan: _Offer) -> _Approval:
        """Leave to make the motion: nobody is asked, and the gate is the application's.

        Raises ApprovalRefused where it does not let the motion pass.
        """
        now_s = self._cell.time_s
        self._gate.show(plan.proposal)
        decision = automatic_decision(plan.proposal, now_s=now_s)
        return _Approval(plan, decision, self._gate.approve(decision, latest=self._seen, now_s=now_s))

    async def execute(self, leave: _Approval) -> _Made:
        """The motion as the cell made it. Raises MotionRefused where the arm's limits do not allow it."""
        made = _Made(leave, self._cell.execute(leave.approved))
        plan = leave.offer.plan
        self._near, self._last = plan.centreline, (plan.branches[plan.best], self._seen.positions)
        self._judge()
        if self._order.ahead and not self._method.alone:
            self._look_ahead(plan)
        return made

    async def learn(self, made: _Made) -> None:
        """Look at what came of it, and learn from it."""
        frames, before, after = self._frames, self._seen, self._see()
        (offer, decision, approved), executed = made
        transition = self._learn(before, executed, after)
        self.played.models.append(self._model)
        if self._listen is not None:
            self._listen(
                EpisodeStep(
                    frames=frames,
                    before=before,
                    plan=offer.plan,
                    proposal=offer.proposal,
                    decision=decision,
                    approved=approved,
                    transition=transition,
                    after=after,
                    model=self._model,
                )
            )
        self._seen = after

    def _has_ended(self, tool: ToolPose) -> bool:
        """True if the object was seen at the goal, as far as the model knows what cameras show of it."""
        x = worker_api.true_positions(self._seen.positions, self._model, tool)
        return self._task.has_ended(x, self._goal, tool)

    def _judge(self) -> None:
        """Score the state by the truth."""
        played, x = self.played, self._task.particles(self._cell.nodes(), self._count)
        played.chamfer_m2.append(float(chamfer_m2(x, self._goal)))
        played.share.append(self._task.success.share(x, self._goal))
        played.reached.append(self._task.is_done(x, self._goal, self._cell.tool))

    def _see(self) -> Particles:
        began_s = time.perf_counter()
        self._frames = self._cell.look() if self._order.eyes == "cameras" else ()
        if self._frames:
            seen = reconstruct(self._frames, self._task.reconstruction(self._order.preset), self._cell.tool)
            positions, surface = seen.positions, seen.surface
        else:
            positions = surface = self._shown_truth()
        return Particles(
            id=fresh_id("particles"),
            cause=tuple(frame.id for frame in self._frames),
            time_s=self._cell.time_s,
            positions=positions,
            surface=surface,
            reconstruction_s=time.perf_counter() - began_s,
        )

    def _shown_truth(self) -> Points:
        """The object without images; a liquid in a world that hides something as a reconstruction has it."""
        hidden = self._order.hidden
        if hidden is None or self._task.perception.held is None:
            return self._noisy(self._task.particles(self._cell.nodes(), self._count))
        tip, told = self._cell.tip, self._cell.tool
        nodes = self._cell.nodes()
        return seen_pour(self._task, nodes, self._count, self._rng, tip=tip, told=told, more=hidden.more)

    def _noisy(self, x: Points) -> Points:
        noisy = x + NOISE_M * self._rng.standard_normal(x.shape)
        noisy[:, 2] = np.maximum(noisy[:, 2], 0.0)
        return noisy.astype(np.float32)

    def _plan(self, x: Points, index: int) -> Plan:
        order = self._order
        ahead, self._ahead = self._ahead, None
        for attempt in range(_ATTEMPTS):
            try:
                return self._plan_once(x, (order.seed, index, attempt), None if attempt else ahead)
            except PlanningError:
                if attempt + 1 == _ATTEMPTS:
                    raise
        raise AssertionError("the last attempt returns or raises")

    def _plan_once(self, x: Points, seeds: tuple[int, ...], ahead: Ahead | None = None) -> Plan:
        order, repeated = self._order, seeds[-1] > 0
        return worker_api.plan(
            *(self._task.name, order.preset, x, self._goal, self._model, hash(seeds) % 2**31, self._site),
            tool=self._cell.tool,
            method=order.otherwise if repeated and order.otherwise else self._method,
            near=self._near,
            orientation=self._orientation,
            remainder=None if self._last is None else remainder_of(*self._last, x),
            ahead=ahead,
        )

    def _look_ahead(self, made: Plan) -> None:
        """Plan for where the object is predicted to lie, before it is looked at."""
        index = len(self.played.decision_s)
        with suppress(PlanningError):
            found = self._plan_once(made.predicted, (self._order.seed, index, 0))
            self._ahead = Ahead(predicted=made.predicted, branches=found.branches, best=found.best)

    def _remember(self, x: Points) -> None:
        """Let a policy that acts alone remember its next actions; in a tree another action may have been made."""
        policy = self._method.policy
        if policy is not None and self._method.alone:
            self._method = replace(self._method, policy=policy.after(x, self._goal, self._cell.tool))

    def _learn(self, before: Particles, executed: Executed, after: Particles) -> Transition:
        transition = Transition.between(before, executed, after)
        self._learnt.append(transition)
        self._orientation = worker_api.track_orientation(self._task.name, self._orientation, transition, self._model)
        if self._order.online:
            task, preset = self._task.name, self._order.preset
            with suppress(DipacError):  # What cannot be learnt from leaves the model as it was, as in the application.
                self._model = worker_api.update(task, preset, self._learnt, self._model, self._site)
        return transition
