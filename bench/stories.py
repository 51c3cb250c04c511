"""A story a task: a hidden cause, the verdict, the extended model, and problems planned with both models.

`python -m bench.stories TASK ... -o FOLDER --problems 10 --jobs N`. Each step is a command that a reader can run, and
is not made again where its result is there; `dipac evaluate` goes on where it was killed. Clouds stand for images, in
recordings and in episodes, so that nothing is rendered.
"""

import json
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, final

import numpy as np
import tyro
from matplotlib.figure import Figure

from app.core.task_name import Split, TaskName
from app.evaluation import results_log
from app.evaluation.figure import save
from app.evaluation.intervals import Measured, mean, share
from app.evaluation.scores import MM2
from app.evaluation.tables import measurement
from app.jobs.worker_api import nominal_model
from app.recording.exchange.model_file import save_model
from app.rig.simulated.effect_sampling import injectable_effects
from bench.hidden.draws import BODIES, Chosen, real_size
from bench.program import ROOT, hidden_in, joined, run

DOCS: Final = ROOT / "docs"
MODELS: Final = ("nominal", "extended")
_PLAIN_STAGES: Final = "s  "
"""In lines of `dipac discover` that tell how far it is."""
_EXTENDED: Final = Path("discovery") / "model.toml"


@final
@dataclass(frozen=True, kw_only=True)
class Story:
    """A cause hidden in recordings of a task, and the problems that are planned in the same world.

    `size`: in typical sizes; `split`, `actions`: which problems, and of how many actions at most; `play_on`: all of
    these are made.
    """

    task: str
    title: str
    about: str
    hidden: str
    size: float
    seed: int
    episodes: int
    motions: int
    split: Split = "easy"
    actions: int | None = None
    play_on: bool = False

    @property
    def order(self) -> dict[str, Any]:
        """Order of the recordings: see `bench.hidden.made`."""
        return {
            "task": self.task,
            "world": "mujoco",
            "seed": self.seed,
            "hidden": [[self.hidden, self.size]],
            "episodes": self.episodes,
            "pushes": self.motions,
            "own": True,
        }

    @property
    def played(self) -> str:
        """Full name of the task that is planned."""
        return str(TaskName(self.task, split=self.split))

    def evaluate(self, model: str, problems: int, jobs: int = 1) -> tuple[str, ...]:
        """The command that plays all problems with one of the models."""
        file = "nominal.toml" if model == "nominal" else str(_EXTENDED)
        limits = [*(["--actions", str(self.actions)] if self.actions else []), *(["--play-on"] if self.play_on else [])]
        sizes = ["--seeds", str(problems), "--preset", "cpu", "--eyes", "truth", *limits, "--jobs", str(jobs)]
        which = ["--task", self.task, "--problems", self.split, "--planner", "dipac"]
        return ("evaluate", *which, "--model", file, "--hidden", "truth.json", *sizes, "-o", model)


STORIES: Final = (
    Story(
        task="bean_sweep",
        title="Beans, and an arm whose strokes have the wrong length",
        about="Every sweep is 15 % shorter, or longer, than it is told.",
        hidden="under_reach",
        size=5.0,
        seed=41,
        episodes=3,
        motions=3,
        actions=8,
        play_on=True,
    ),
    Story(
        task="cloth_hang",
        title="A cloth, and an arm whose strokes have the wrong length",
        about="Every stroke is 12 % shorter, or longer, than it is told, from where the gripper was lowest.",
        hidden="under_reach",
        size=4.0,
        seed=11,
        episodes=3,
        motions=3,
        actions=10,
    ),
    Story(
        task="pour_water",
        title="Water, and a bowl that is held elsewhere",
        about="The held bowl is 18 mm from where the kinematics have it; the other one is narrow, and far.",
        hidden="tcp_offset",
        size=6.0,
        seed=66,
        episodes=4,
        motions=3,
        split="hard",
    ),
    Story(
        task="pour_soup",
        title="Soup, and a bowl that is held elsewhere",
        about="As with water, the other way; pieces swim in it.",
        hidden="tcp_offset",
        size=6.0,
        seed=65,
        episodes=4,
        motions=3,
        split="hard",
    ),
)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Pair:
    """Rows of one problem, played with both models; distances [m^2] and shares at the end."""

    seed: int
    rows: Mapping[str, Mapping[str, Any]]

    def gain(self, name: str) -> float:
        """Difference of a number, the extended model's less the nominal one's."""
        return float(self.rows["extended"][name]) - float(self.rows["nominal"][name])


def told_of(story: Story) -> str:
    """The story's row in the page's table of them."""
    main = injectable_effects()[story.hidden].main_in(BODIES[story.task])
    size = (
        f"`{story.hidden}`, {real_size(Chosen(effect=story.hidden, size=story.size), BODIES[story.task]):g} {main.unit}"
    )
    limits = f", {story.actions} actions{'' if story.play_on else ' at most'}" if story.actions else ""
    recorded = f"{story.episodes} episodes of {story.motions} motions, seed {story.seed}"
    return f"| `{story.task}` | {size} | {recorded} | {story.split} problems{limits} |"


def told(story: Story, folder: Path, problems: int, jobs: int) -> list[Pair]:
    """Make what is missing of a story in its folder, step by step; its problems as far as both models ended them."""
    folder.mkdir(parents=True, exist_ok=True)
    order, wanted = folder / "order.json", json.dumps(story.order)
    if (folder / "truth.json").exists() and order.read_text(encoding="utf-8") != wanted:
        raise SystemExit(f"{folder} holds a story of another order; give another -o, or move that folder away.")
    if not (folder / "truth.json").exists():
        shutil.rmtree(folder / "recordings", ignore_errors=True)
        order.write_text(wanted, encoding="utf-8")
        print(f"{story.task}: recordings", flush=True)
        run(("order.json", "-o", "."), folder, module="bench.hidden.made", shown=True)
    if not (folder / "verdict.txt").exists():
        print(f"{story.task}: discovery, of minutes", flush=True)
        said = run(DISCOVER, folder, shown=True)
        kept = [line.rstrip() for line in said.splitlines() if _PLAIN_STAGES not in line[:12]]
        (folder / "verdict.txt").write_text("\n".join(kept).strip() + "\n", encoding="utf-8")
    if not (folder / "nominal.toml").exists():
        save_model(folder / "nominal.toml", nominal_model(story.task))
    for model in MODELS:
        print(f"{story.task}: {problems} problems with the {model} model", flush=True)
        run(story.evaluate(model, problems, jobs), folder, shown=True)
    return pairs(folder, problems)


DISCOVER: Final = ("discover", "recordings/*.mcap", "-o", "discovery")


def pairs(folder: Path, problems: int) -> list[Pair]:
    """The problems that both models have played."""
    found = {
        model: {row["seed"]: row for row in results_log.latest(folder / model / "episodes.jsonl")} for model in MODELS
    }
    return [
        Pair(seed=seed, rows={model: found[model][seed] for model in MODELS})
        for seed in range(problems)
        if all(found[model].get(seed, {}).get("chamfer_m2") is not None for model in MODELS)
    ]


def table(found: Sequence[Pair]) -> str:
    """Both models and their paired difference, as Markdown."""
    lines = ["| model | n | failed | success | final Chamfer [mm^2] | share there |", "|---|---|---|---|---|---|"]
    for model in MODELS:
        rows = [pair.rows[model] for pair in found]
        success = measurement(share(bool(row["success"]) for row in rows), 100.0, "%")
        chamfer = measurement(mean(float(row["chamfer_m2"]) for row in rows), MM2)
        reward = measurement(mean(float(row["reward"]) for row in rows), 1.0)
        failed = sum(bool(row["failure"]) for row in rows)
        lines.append(f"| {model} | {len(rows)} | {failed} | {success} | {chamfer} | {reward} |")
    chamfer, reward = gains(found)
    better = sum(pair.gain("chamfer_m2") < 0 for pair in found)
    nearer = f"{measurement(chamfer, MM2)}, nearer in {better}"
    lines.append(f"| extended - nominal, paired | {len(found)} | | | {nearer} | {measurement(reward, 1.0)} |")
    return "\n".join(lines) + "\n"


def gains(found: Sequence[Pair]) -> tuple[Measured, Measured]:
    """Means of the paired differences of final Chamfer distance [m^2] and of the share that is there, of 95 %."""
    chamfer, reward = (mean(pair.gain(name) for pair in found) for name in ("chamfer_m2", "reward"))
    return chamfer, reward


def draw(story: Story, found: Sequence[Pair], path: Path) -> None:
    """Distance to each goal before and after the actions of either model, and the paired differences."""
    figure = Figure(figsize=(9.5, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(2, 1))
    places = np.arange(len(found))
    begin = [MM2 * pair.rows["nominal"]["chamfers_m2"][0] for pair in found]
    left.scatter(places, begin, marker="_", color="0.5", label="before")
    for model, colour, marker in zip(MODELS, ("tab:orange", "tab:blue"), ("o", "s"), strict=True):
        after = [MM2 * pair.rows[model]["chamfer_m2"] for pair in found]
        left.scatter(places, after, marker=marker, color=colour, label=f"after, {model}")
    left.set(yscale="log", xlabel="problem", ylabel="Chamfer distance to the goal [mm$^2$]", xticks=places)
    left.set_xticklabels([str(pair.seed) for pair in found])
    left.set_title(f"{story.played}: planned with both models")
    left.legend(fontsize="small")
    each, (middle, low, high, _) = [MM2 * pair.gain("chamfer_m2") for pair in found], gains(found)[0]
    right.axvline(0.0, color="0.7", linewidth=1)
    right.scatter(each, np.zeros(len(each)), color="0.4", s=14)
    ends = [[MM2 * (middle - low)], [MM2 * (high - middle)]] if np.isfinite([low, high]).all() else None
    right.errorbar([MM2 * middle], [0.5], xerr=ends, fmt="D", color="tab:blue", capsize=4)
    right.set(yticks=[0.0, 0.5], yticklabels=["each", "mean"], ylim=(-0.5, 1.0), xlabel="extended - nominal [mm$^2$]")
    right.set_title("paired, 95 %")
    save(figure, path, salt=story.task)


def section(story: Story, printed: str, truth: Mapping[str, Any], found: Sequence[Pair], problems: int) -> str:
    """A story as the page has it."""
    order = f"echo '{json.dumps(story.order)}' > order.json\npython -m bench.hidden.made order.json -o ."
    commands = "\n".join(f"dipac {joined(each)}" for each in (DISCOVER, *(story.evaluate(m, problems) for m in MODELS)))
    return (
        f"## {story.title}\n\n{story.about}\n\n```\n{order}\n{commands}\n```\n\n```text\n{printed.rstrip()}\n```\n\n"
        f"Hidden was: {hidden_in(truth)}.\n\n{table(found)}\n![Both models](images/story-{story.task}.svg)\n"
    )


def main(
    tasks: Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(help="all where none is named")] = (),
    *,
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"], help="a folder for each task, found again")],
    problems: int = 10,
    jobs: Annotated[int, tyro.conf.arg(help="episodes at a time")] = 1,
) -> None:
    """Make the stories, and write of each OUTPUT/TASK.md, OUTPUT/images/story-TASK.svg and OUTPUT/TASK.jsonl."""
    chosen = [story for story in STORIES if not tasks or story.task in tasks]
    if unknown := sorted(set(tasks) - {story.task for story in STORIES}):
        raise SystemExit(f"No story of {', '.join(unknown)}; there are: {', '.join(s.task for s in STORIES)}.")
    (output / "images").mkdir(parents=True, exist_ok=True)
    for story in chosen:
        folder = output / story.task
        found = told(story, folder, problems, jobs)
        if not found:
            print(f"{story.task}: no problem was played with both models; see {folder}.")
            continue
        truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
        printed = (folder / "verdict.txt").read_text(encoding="utf-8")
        draw(story, found, output / "images" / f"story-{story.task}.svg")
        (output / f"{story.task}.md").write_text(section(story, printed, truth, found, problems), encoding="utf-8")
        rows = [{"model": model, **pair.rows[model]} for pair in found for model in MODELS]
        (output / f"{story.task}.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
        print(table(found))


if __name__ == "__main__":
    tyro.cli(main)
