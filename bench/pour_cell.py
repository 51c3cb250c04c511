"""Pouring in the simulated cell, with the reference problem's reward: `python -m bench.pour_cell EPISODES.jsonl`.

The file is what `dipac evaluate --task pour_water pour_soup -o OUTPUT` leaves in OUTPUT.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, final

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table


@final
@dataclass(frozen=True, kw_only=True)
class Options:
    """Selection of the episodes."""

    episodes: tyro.conf.Positional[Path]


class Row(NamedTuple):
    """Results of a method in a task over its seeds: share in the bowl, its least, rewards, decisions, their seconds."""

    task: str
    method: str
    seeds: int
    share: float
    least: float
    reward: float
    normalised: float
    decisions: float
    decision_s: float
    longest_s: float


def reward(chamfer_m2: float) -> float:
    """exp(-10 d) of the root mean square distance d [m] to the goal's nearest particles and back, over sqrt 3.

    As the reference problem of pouring has it, but for its pairing of particles by index, which cameras do not know.
    """
    return float(np.exp(-10.0 * np.sqrt(chamfer_m2 / 2 / 3)))


def normalised(reached: float, nothing: float) -> float:
    """A reward as a share of the possible gain over that of doing nothing."""
    return (reached - nothing) / (1.0 - nothing)


def row(task: str, method: str, episodes: Sequence[dict[str, Any]]) -> Row:
    """Aggregate of all episodes of a method."""
    shares = [episode["reward"] for episode in episodes]
    ends = [(reward(episode["chamfers_m2"][-1]), reward(episode["chamfers_m2"][0])) for episode in episodes]
    took = [second for episode in episodes for second in episode["decisions_s"]]
    return Row(
        task=task,
        method=method,
        seeds=len(episodes),
        share=float(np.mean(shares)),
        least=min(shares),
        reward=float(np.mean([end for end, _ in ends])),
        normalised=float(np.mean([normalised(end, begin) for end, begin in ends])),
        decisions=len(took) / len(episodes),
        decision_s=float(np.median(took)),
        longest_s=max(took),
    )


def main(options: Options) -> None:
    """A line a method and task."""
    groups = dict[tuple[str, str], list[dict[str, Any]]]()
    for line in options.episodes.read_text(encoding="utf-8").splitlines():
        episode = json.loads(line)
        if episode["chamfers_m2"] and episode["decisions_s"]:
            groups.setdefault((episode["task"], f"{episode['planner']} {episode['ablation']}"), []).append(episode)
    table = Table(*Row._fields, title="Pouring in the simulated cell: shares and rewards are the truth's")
    for (task, method), episodes in sorted(groups.items()):
        numbers = row(task, method, episodes)
        table.add_row(*(f"{value:.3g}" if isinstance(value, float) else str(value) for value in numbers))
    Console().print(table)


if __name__ == "__main__":
    main(tyro.cli(Options))
