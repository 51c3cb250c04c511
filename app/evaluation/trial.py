"""One episode as a row of an evaluation: plain data in and out, to be run in any process of any machine."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

import numpy as np

from app.config import Site
from app.core.errors import UsageError
from app.core.geometry.scene_description import RopeModel, Stage
from app.core.messages import Model
from app.evaluation.episode import EvaluationConfig, Eyes, play
from app.jobs import worker_api
from app.planner.method import PAPER, Method, planners
from app.policy.learned import kinds
from app.recording.exchange.model_file import load_model
from app.rig.simulated.hidden_world import HiddenWorld, load_hidden_world
from app.tasks import load

if TYPE_CHECKING:  # Whoever lists trials shall not load JAX for them.
    from app.policy.learned.base import LearnedPolicy

WHOLE = "none"
"""The name of what leaves nothing out, where ablations are listed."""


GUIDED = "+"
"""Separator of a planner and the kind of learned policy that guides it."""
POLICIES = Path("policies")
"""Default folder of learned policies."""
ALONE = replace(Method.of(ablation="no_planning"), calibrated=False)
"""A policy's actions as they are."""


@final
@dataclass(frozen=True, kw_only=True)
class Trial:
    """An episode of `task` by `planner` with an `ablation`, or `none`.

    `planner`: a planner, a kind of learned policy that acts alone, or `dipac+KIND`, which it guides. `policies`: where
    these are, as TASK/KIND. `model`: the file of the calibrated model; None where the method does without.
    `hidden`: the sealed file of `dipac hide` whose world is played in.
    """

    task: str
    planner: str
    ablation: str
    seed: int
    preset: str
    eyes: Eyes = "cameras"
    online: bool = False
    model: Path | None = None
    policies: Path | None = None
    actions: int | None = None
    play_on: bool = False
    world: RopeModel = "chain"
    hidden: Path | None = None

    @property
    def key(self) -> str:
        """Unique key in an evaluation."""
        return f"{self.task} {self.planner} {self.ablation} {self.seed}"

    @property
    def settings(self) -> dict[str, Any]:
        """Settings that all episodes of an evaluation share, as in their rows."""
        names = ("preset", "eyes", "online", "actions", "play_on", "world")
        world = self.hidden_world
        return {name: getattr(self, name) for name in names} | {"hidden": world and str(world)}

    @property
    def stage(self) -> Stage:
        """The task's stage, in the rope's world of the trial."""
        return load(self.task).stage.in_world(self.world)

    @property
    def hidden_world(self) -> HiddenWorld | None:
        """The world of `hidden`. Raises UsageError where it cannot be played in."""
        if self.hidden is None:
            return None
        found = load_hidden_world(self.hidden, self.task, self.stage.body)
        if found.in_motion:
            late = ", ".join(found.in_motion)
            raise UsageError(f"{self.hidden} hides {late}, which does nothing here: what is looked at is at rest.")
        if self.eyes == "truth" and found.in_images:
            unseen = ", ".join(found.in_images)
            raise UsageError(f"{self.hidden} hides {unseen}, which images alone have; play it with --eyes cameras.")
        return found

    @property
    def follows(self) -> bool:
        """True if the model learns from each action: on request, or because it was fitted to another object.

        False if no decision uses the model.
        """
        method, asked = self.method, self.online or load(self.task).training_variant is not None
        return asked and method.calibrated and method.following and not method.alone

    @property
    def method(self) -> Method:
        """Planning method. Raises UsageError for a planner, an ablation or a policy that does not exist."""
        planner, _, kind = self.planner.rpartition(GUIDED)
        if not planner and kind not in kinds.names():
            return Method.of(self.planner, None if self.ablation == WHOLE else self.ablation)
        policy = _policy(self.policies or POLICIES, self.task, kind)
        return replace(Method.of(planner) if planner else ALONE, policy=policy)


def playable() -> list[str]:
    """All names that a trial's planner may have."""
    alone = kinds.names()
    return [*planners(), *alone, *(f"{PAPER}{GUIDED}{kind}" for kind in alone)]


def run_trial(trial: Trial) -> dict[str, Any]:
    """Play it, and return its row of results, `failure` included; errors of the program itself are raised."""
    began_s, method = time.perf_counter(), trial.method
    model, hidden = _model(trial, method), trial.hidden_world
    order = EvaluationConfig(
        task=replace(load(trial.task), stage=trial.stage),
        preset=trial.preset,
        seed=trial.seed,
        method=method,
        model=model,
        online=trial.follows,
        eyes=trial.eyes,
        actions=trial.actions,
        play_on=trial.play_on,
        hidden=hidden,
    )
    learning = trial.follows
    for stage in range(len(worker_api.warm_up_stages(trial.task, trial.preset, model, method, learning=learning))):
        worker_api.warm_up_stage(trial.task, trial.preset, stage, model, method, learning=learning)
    played = play(order, site=Site())
    return asdict(trial) | {
        "policies": str(trial.policies) if trial.policies and method.policy else None,
        "policy_digest": method.policy.digest if method.policy else None,
        "model": str(trial.model) if trial.model and method.calibrated else None,
        "hidden": hidden and str(hidden),
        "chamfer_m2": played.chamfer_m2[-1] if played.chamfer_m2 else None,
        "success": played.success,
        "done": played.done,
        "reward": played.share[-1] if played.share else 0.0,
        "decision_s": float(np.mean(played.decision_s)) if played.decision_s else 0.0,
        "failure": played.failure,
        "chamfers_m2": played.chamfer_m2,
        "rewards": played.share,
        "decisions_s": played.decision_s,
        "parameters": [_calibrated_values(trial.task, model) for model in played.models] if order.online else [],
        "took_s": time.perf_counter() - began_s,
    }


@lru_cache
def _policy(folder: Path, task: str, kind: str) -> LearnedPolicy:
    from app.jobs.teaching import load_learned

    known = load(task)
    return load_learned(folder / known.problem / kind, known, kind)


def _model(trial: Trial, method: Method) -> Model:
    """The calibrated model from its file; without calibration, the simulator's without any demonstration."""
    if not method.calibrated:
        return worker_api.uncalibrated_model(trial.task)
    if trial.model is None:
        return worker_api.nominal_model(trial.task)
    model = load_model(trial.model, task=trial.task, time_s=0.0)
    worker_api.check_model(model)
    return model


def _calibrated_values(task: str, model: Model) -> dict[str, float]:
    return {name: model.value(name) for name in load(task).calibrated}
