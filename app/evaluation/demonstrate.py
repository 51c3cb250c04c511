"""Demonstrations by a task's scripted expert, their recordings, and the model that they calibrate."""

import itertools
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, TypeAlias

from app import __version__
from app.core.dialogue.summary import Summary
from app.core.errors import RecordingError
from app.core.geometry.object_description import ObjectDescription
from app.core.geometry.scene_description import Rope, RopeModel
from app.core.messages import Episode, Message, Transition, fresh_id
from app.evaluation.episode import EpisodeResults, EpisodeStep, EvaluationConfig, Eyes, play
from app.jobs.worker_api import calibrate, nominal_model
from app.planner.method import Method
from app.recording.exchange.model_file import save_model
from app.recording.format import digests
from app.recording.format.clock_offset import Epoch
from app.recording.write.file import EpisodeFile
from app.tasks import load
from app.tasks.elements.base import EpisodeConfig
from app.tasks.elements.descriptions import with_appearance

Expert: TypeAlias = Literal["scripted", "descended", "planned"]
"""Demonstrator: the task's scripted policy, the same with its actions improved by descent, or the planner.

Each takes longer than the one before and errs less. The actions of the first two follow from the observation, as a
policy's will; the planner also uses random actions, and decides where descent alone finds no feasible one."""
EXPERTS: Mapping[Expert, Method] = MappingProxyType(
    {
        "scripted": Method.of(ablation="no_planning"),
        "descended": Method(branching=False),
        "planned": Method.of(),
    }
)
FIRST_SEED = 1000
"""First seed of demonstrations: other problems than those of evaluations, which count from 0."""


class Demonstration(NamedTuple):
    """An episode of the expert: its configuration, every action, and the outcome."""

    config: EpisodeConfig
    steps: Sequence[EpisodeStep]
    played: EpisodeResults


def demonstrations(
    task: str,
    preset: str,
    seeds: range,
    eyes: Eyes,
    expert: Expert = "scripted",
    world: RopeModel = "chain",
    description: ObjectDescription | None = None,
) -> Iterator[Demonstration]:
    """Each episode of the expert, in the order of the seeds; of its training variant, where the task has one.

    `description`: its object, in other colours or with known parameters.
    """
    known = with_appearance(load(task).demonstration_task, description)
    known, method = replace(known, stage=known.stage.in_world(world)), EXPERTS[expert]
    model = nominal_model(task, () if description is None else description.priors)
    for seed in seeds:
        steps = list[EpisodeStep]()
        otherwise = EXPERTS["planned"] if expert == "descended" else None
        order = EvaluationConfig(
            task=known, preset=preset, seed=seed, method=method, model=model, eyes=eyes, otherwise=otherwise
        )
        yield Demonstration(order.episode, steps, play(order, steps.append))


def record(shown: Demonstration, path: Path, setup: Mapping[str, Any] = MappingProxyType({})) -> int:
    """Write it as a new recording, dated by the world's clock from now on; returns the number of messages.

    `setup`: what its configuration says of the collection besides. Raises RecordingError where the file cannot be
    written.
    """
    config = shown.config
    begin_s = shown.steps[0].before.time_s if shown.steps else 0.0
    episode = Episode(
        id=fresh_id("episode"),
        time_s=begin_s,
        task=config.task.recorded_name,
        rig="simulated",
        seed=config.seed,
        simulated=True,
        code_version=__version__,
        config=json.dumps(
            {"preset": config.preset, "actions": config.pushes, "expert": True, **_world(config), **setup}
        ),
    )
    said = [episode, *_messages(shown)]
    try:
        file = EpisodeFile(path, episode, epoch=Epoch(offset_ns=time.time_ns()))
        try:
            for message in said:
                file.write(message, now_s=message.time_s)
        finally:
            file.close()
        digests.note(path)
    except (OSError, RuntimeError) as error:
        raise RecordingError(f"Cannot write to {path}: {error}; choose another place with -o.") from error
    return len(said)


def _world(config: EpisodeConfig) -> dict[str, str]:
    """Configuration of a simulated rope, as in an episode's recording."""
    body = config.task.stage.body
    return {"world": body.model} if isinstance(body, Rope) else {}


def _messages(shown: Demonstration) -> Iterator[Message]:
    """Messages that the running application would have published."""
    config, summary = shown.config, Summary()
    assert config.model is not None
    yield config.model
    yield config.goal
    for step, later in itertools.zip_longest(shown.steps, shown.steps[1:]):
        if step is shown.steps[0]:
            yield from step.frames
            yield step.before
        executed = step.transition.executed
        yield step.proposal
        yield step.decision
        yield step.approved
        yield executed
        if later is not None:
            yield from later.frames
        yield step.after
        yield step.transition
        yield summary.score(
            step.proposal, step.before, executed, step.after, config.target, now_s=step.transition.time_s
        )


def write_calibrated_model(
    task: str, preset: str, episodes: int, eyes: Eyes, output: Path, world: RopeModel = "chain"
) -> Path:
    """Write the model that so many demonstrations calibrate to the file `output`.

    Raises RecordingError where none of them moved anything.
    """
    seen = list[Transition]()
    seeds = range(FIRST_SEED, FIRST_SEED + episodes)
    for shown in demonstrations(task, preset, seeds, eyes, world=world):
        seen += [step.transition for step in shown.steps]
    if not seen:
        raise RecordingError(f"The expert of {task} made no action in {episodes} episodes; is its aim reached already?")
    save_model(output, calibrate(task, preset, seen, nominal_model(task)))
    return output
