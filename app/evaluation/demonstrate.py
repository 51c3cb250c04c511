"""Demonstrations by a task's scripted expert, and the model that they calibrate."""

from collections.abc import Iterator
from pathlib import Path

from app.core.errors import RecordingError
from app.core.messages import Transition
from app.evaluation.play import Eyes, Order, Played, Step, play
from app.planner.method import Method
from app.recording.model_file import save_model
from app.tasks import load
from app.tasks.jobs import calibrate, nominal_model

EXPERT = Method.named(ablation="no_planning")
"""The policy's actions as they are."""
FIRST_SEED = 1000
"""Of demonstrations: other problems than those of evaluations, which count from 0."""


def demonstrations(task: str, preset: str, seeds: range, eyes: Eyes) -> Iterator[tuple[int, list[Step], Played]]:
    """Each episode of the expert with its seed, in order."""
    for seed in seeds:
        steps = list[Step]()
        model = nominal_model(task)
        order = Order(task=load(task), preset=preset, seed=seed, method=EXPERT, model=model, eyes=eyes)
        yield seed, steps, play(order, steps.append)


def calibrated(task: str, preset: str, episodes: int, eyes: Eyes, output: Path) -> Path:
    """Write the model that so many demonstrations calibrate to the file `output`.

    Raises RecordingError where none of them moved anything.
    """
    seen = list[Transition]()
    for _, steps, _ in demonstrations(task, preset, range(FIRST_SEED, FIRST_SEED + episodes), eyes):
        seen += [step.transition for step in steps]
    if not seen:
        raise RecordingError(f"The expert of {task} made no action in {episodes} episodes; is its aim reached already?")
    save_model(output, calibrate(task, preset, seen, nominal_model(task)))
    return output
