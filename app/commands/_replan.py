"""Replanning at a moment of a recording, with another model or the same one."""

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial, reduce
from pathlib import Path
from typing import Any, cast, final

from anyio import to_thread

from app.commands._guiding import with_policy
from app.config import Limits, Site
from app.core.errors import UsageError
from app.core.geometry.object_description import recorded_object
from app.core.messages import Episode, Goal, Model, Particles, Proposal
from app.core.system.worker import Worker
from app.core.types import ToolPose
from app.jobs.worker_api import check_model, choose_preset, nominal_model, plan, warm_up_stage, warm_up_stages
from app.planner.method import PAPER, Method
from app.recording.exchange.model_file import load_model
from app.recording.read.timeline import Timeline
from app.tasks import Task, load
from app.tasks.elements.base import EpisodeConfig
from app.ui.parts.console_state import ConsoleState
from app.ui.replanning import AS_RECORDED, Replanned, ReplanRequest


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedState:
    """State of a session at some time. `then`: the plan that was up or being executed, or else the next one."""

    time_s: float
    episode: Episode
    particles: Particles
    goal: Goal
    model: Model | None
    tool: ToolPose | None
    then: Proposal | None

    @property
    def config(self) -> Mapping[str, Any]:
        """Configuration that the episode was started with; empty if none was recorded."""
        try:
            said = json.loads(self.episode.config)
        except ValueError:
            return {}
        return cast(dict[str, Any], said) if isinstance(said, dict) else {}

    @property
    def options(self) -> Mapping[str, Any]:
        """Options of the command line at that time."""
        said = self.config.get("options")
        return cast(dict[str, Any], said) if isinstance(said, dict) else {}


def moment(timeline: Timeline, time_s: float) -> RecordedState:
    """State at `time_s` [s]. Raises UsageError if that is too little to plan with."""
    state = reduce(ConsoleState.after, timeline.at(time_s), ConsoleState(replay=True))
    lacking = [name for name, seen in (("object", state.particles), ("goal", state.goal)) if seen is None]
    if state.particles is None or state.goal is None:
        raise UsageError(
            f"At {time_s:.2f} s of {timeline.path} no {' and no '.join(lacking)} had been seen, so that nothing can be "
            "planned; choose a later moment, or a recording that has them."
        )
    return RecordedState(
        time_s=timeline.clock(time_s),
        episode=timeline.episode(time_s),
        particles=state.particles,
        goal=state.goal,
        model=state.model,
        tool=state.arm.tool if state.arm else None,
        then=timeline.plan_about(time_s),
    )


def model_names(timeline: Timeline) -> dict[str, Model]:
    """The models of a recording by their names in a list."""
    return {f"{number}: version {model.version}": model for number, model in enumerate(timeline.models, start=1)}


async def replan(planner: Worker, timeline: Timeline, order: ReplanRequest, said: Callable[[str], None]) -> Replanned:
    """Plan the moment of `order` again, in the process `planner`; `said` is called with progress.

    Raises UsageError where that moment cannot be planned, and what loading the model and `app.jobs.worker_api.plan`
    raise.
    """
    seen = await to_thread.run_sync(moment, timeline, order.time_s)
    chosen, called = await _model(planner, timeline, order, seen)
    task = load(chosen.task)
    preset = await _preset(planner, task, seen)
    model = _sendable(chosen)
    method = Method.of(str(seen.options.get("planner") or PAPER), seen.options.get("ablation"))
    if policy := seen.options.get("policy"):
        method = await to_thread.run_sync(with_policy, method, Path(str(policy)), task.name)
    config = EpisodeConfig(
        task=task,
        preset=preset,
        goal=seen.goal,
        model=model,
        seed=seen.episode.seed,
        pushes=0,
        automatic=False,
        calibrating=False,
        method=method,
    )
    for index, stage in enumerate(await planner.run(warm_up_stages, task.name, preset, model, method)):
        said(f"Compiling {stage}.")
        await planner.run(warm_up_stage, task.name, preset, index, model, method)
    said(f"Planning with {called}.")
    began_s, x, goal = time.monotonic(), seen.particles.positions, seen.goal.positions
    found = await planner.run(plan, task.name, preset, x, goal, model, config.seed, _site(seen), seen.tool, method)
    plan_s = time.monotonic() - began_s
    again = config.proposal(found, seen.particles, model, began_s=seen.time_s - plan_s, now_s=seen.time_s)
    return Replanned(then=seen.then, again=again, model=called)


async def _preset(planner: Worker, task: Task, seen: RecordedState) -> str:
    """Preset of the episode; if unknown, one for so many particles, and of several the one for this machine.

    Raises UsageError where there is none.
    """
    count, said = len(seen.particles.positions), seen.config.get("preset")
    fitting = [name for name, preset in task.presets.items() if preset.particle_count == count]
    if said in fitting:
        return str(said)
    if not fitting:
        known = ", ".join(f"{preset.particle_count} ({name})" for name, preset in task.presets.items())
        raise UsageError(
            f"The object was recorded as {count} particles, and {task.name} is planned with {known}; use a recording "
            f"made with one of these presets."
        )
    best = await planner.run(choose_preset)
    return best if best in fitting else fitting[0]


async def _model(planner: Worker, timeline: Timeline, order: ReplanRequest, seen: RecordedState) -> tuple[Model, str]:
    """The model to plan with, and its name. Raises UsageError, RecordingError or ParameterError."""
    if order.path:
        path = Path(order.path)
        read = partial(load_model, path, task=seen.episode.task, time_s=seen.time_s, whole=False)
        model = await to_thread.run_sync(read)
        await planner.run(check_model, model)
        return model, path.name
    if order.model != AS_RECORDED:
        known = await to_thread.run_sync(model_names, timeline)
        if order.model not in known:
            raise UsageError.unknown("model", order.model, known)
        return known[order.model], f"version {known[order.model].version}"
    if seen.model is not None:
        return seen.model, f"version {seen.model.version}"
    description = recorded_object(seen.episode.config)
    priors = () if description is None else description.priors
    name = str(seen.config.get("task", seen.episode.task))
    return await planner.run(nominal_model, name, priors), "the nominal model"


def _sendable(model: Model) -> Model:
    """The same, but for a mapping that cannot be sent to another process: those of recordings are read-only."""
    return replace(model, extension=replace(model.extension, recordings=dict(model.extension.recordings)))


def _site(seen: RecordedState) -> Site:
    """The default site with the speed that was allowed then."""
    speed = seen.options.get("speed")
    most = Limits().speed_m_s
    return Site(limits=Limits(speed_m_s=min(float(speed), most) if isinstance(speed, int | float) else most))
