"""Transfer of a model calibrated on the rod to the rope, push by push: a table, a plot and a picture.

`python -m bench.transfer table EVALUATION` reads what `dipac evaluate --task rod_to_rope` wrote to the folder
EVALUATION; `python -m bench.transfer picture` plays one episode before the simulated cameras, and `guided` two with a
policy that was learned from rods.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import tyro

from app.config import Site
from app.core.messages import Model
from app.core.types import ColourImage
from app.evaluation import results_log
from app.evaluation.episode import EpisodeStep, EvaluationConfig, play
from app.evaluation.trial import ALONE, WHOLE
from app.jobs.teaching import SHIPPED, load_learned
from app.jobs.worker_api import nominal_model
from app.planner.method import DIPAC, PAPER, Method
from app.recording.exchange.model_file import load_model
from app.rig.simulated.lockstep import LockStep
from app.sim.model.params import PARAMETERS, index
from app.tasks import load
from bench.task_pictures import images as of_policy
from bench.task_pictures import save

TASK: Final = "rod_to_rope"


def table(evaluation: tyro.conf.Positional[Path], images: Path = Path("docs/images")) -> None:
    """Print the parameters before the first push and after each, seed by seed; draw them into `images`.

    Args:
        evaluation: a folder of results, with the model that demonstrations on the rod calibrated.
        images: where the plot goes.
    """
    rows = [row for row in results_log.latest(evaluation / "episodes.jsonl") if _online(row)]
    start = load_model(evaluation / "models" / f"{TASK}.toml", task=TASK, time_s=0.0)
    names = load(TASK).calibrated
    print(f"| seed | push | {' | '.join(map(_headed, names))} | beyond the wall |")
    print("| --- " * (3 + len(names)) + "|")
    for row in rows:
        for push, (values, share) in enumerate(zip(_followed(start, row), row["rewards"], strict=True)):
            told = " | ".join(f"{values[name]:.3g}" for name in names)
            print(f"| {row['seed']} | {push or 'rod'} | {told} | {100 * share:.0f} % |")
    print(_draw(rows, start, names, images / f"{TASK}-parameters.svg"))


def picture(
    model: Path | None = None, seed: int = 0, camera: int = 0, shown: int = 4, images: Path = Path("docs/images")
) -> None:
    """Write what a camera sees of the rod and its expert, and of the rope and a model that follows it.

    Args:
        model: the rod's; the task's nominal one where none is named.
        seed: of the problems.
        camera: which of the simulated ones.
        shown: so many images, evenly over an episode.
        images: where the pictures go, as rod_to_rope-rod.png and rod_to_rope.png.
    """
    task, known = load(TASK), load_model(model, task=TASK, time_s=0.0) if model else nominal_model(TASK)
    rod = images / f"{TASK}-rod.png"
    print(f"{rod}: {save(of_policy(task.demonstration_task, seed, camera), shown, rod)} pushes")
    rope = images / f"{TASK}.png"
    seen = _seen(DIPAC, known, seed, camera)
    print(f"{rope}: {save(seen, shown, rope)} pushes")


def guided(
    policy: Path = SHIPPED,
    model: Path | None = None,
    seed: int = 0,
    camera: int = 0,
    shown: int = 4,
    images: Path = Path("docs/images"),
) -> None:
    """Write what a camera sees of a rope that a policy learned from rods pushes alone, and as it guides the tree.

    Args:
        policy: a folder of `dipac train`, or `shipped`.
        model: the rod's; the task's nominal one where none is named.
        seed: of the problems.
        camera: which of the simulated ones.
        shown: so many images, evenly over an episode.
        images: where the pictures go, as rod_to_rope-alone.png and rod_to_rope-guided.png.
    """
    known = load_model(model, task=TASK, time_s=0.0) if model else nominal_model(TASK)
    found = load_learned(policy, load(TASK))
    for name, method in (("alone", ALONE), ("guided", DIPAC)):
        file = images / f"{TASK}-{name}.png"
        seen = _seen(replace(method, policy=found), known, seed, camera)
        print(f"{file}: {save(seen, shown, file)} pushes")


def _seen(method: Method, model: Model, seed: int, camera: int) -> Sequence[ColourImage]:
    """Images of a camera in an episode, before and after each push."""
    task, steps = load(TASK), list[EpisodeStep]()
    order = EvaluationConfig(task=task, preset="cpu", seed=seed, method=method, model=model, online=method.branching)
    played = play(order, steps.append)
    if played.failure:
        raise SystemExit(played.failure)
    print(f"{100 * played.share[-1]:.0f} % beyond the wall")
    cell = LockStep(task.stage, task.start(seed), Site(), seed)  # The same motions move the same rope again.
    seen = [cell.look()[camera].color]
    for step in steps:
        cell.execute(step.approved)
        seen.append(cell.look()[camera].color)
    return seen


def _online(row: dict[str, Any]) -> bool:
    return row["task"] == TASK and row["planner"] == PAPER and row["ablation"] == WHOLE and not row["failure"]


def _followed(start: Model, row: dict[str, Any]) -> list[dict[str, float]]:
    """The calibrated parameters: the rod's, and after each push."""
    return [{name: start.value(name) for name in load(TASK).calibrated}, *row["parameters"]]


def _headed(name: str) -> str:
    unit = PARAMETERS[index(name)].unit
    return name.replace("_", " ") + (f" [{unit}]" if unit != "1" else "")


def _draw(rows: Sequence[dict[str, Any]], start: Model, names: Sequence[str], path: Path) -> Path:
    """A panel a parameter, a line a seed."""
    from matplotlib import rc_context  # Takes a second to load, which nobody pays who draws nothing.
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 2.4 * len(names)), layout="constrained")
    panels = np.atleast_1d(figure.subplots(len(names), sharex=True))
    for panel, name in zip(panels, names, strict=True):
        for row in rows:
            values = [each[name] for each in _followed(start, row)]
            panel.plot(values, ".-", linewidth=1, label=f"seed {row['seed']}")
        panel.set(ylabel=_headed(name), yscale="log")
    panels[0].set_title("From the rod to the rope: one line an episode")
    panels[0].legend(fontsize="x-small", ncols=5)
    panels[-1].set_xlabel("pushes of the rope (0: as calibrated on the rod)")
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": TASK}):  # The same rows give the same bytes.
        figure.savefig(path, metadata={"Date": None})
    return path


if __name__ == "__main__":
    tyro.extras.subcommand_cli_from_dict({"table": table, "picture": picture, "guided": guided})
