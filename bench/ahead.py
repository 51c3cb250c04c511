"""Plans made while the arm moves: how often they are taken, what that saves, and what it costs. See `--help`."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import tyro

from app.config import Site
from app.evaluation.episode import EpisodeResults, EvaluationConfig, play
from app.jobs import worker_api
from app.jobs.worker_api import choose_preset
from app.planner.method import DIPAC
from app.tasks import load


@dataclass(frozen=True, kw_only=True, eq=False)
class Pair:
    """The same problem by decisions after each look, and with plans that were made ahead."""

    without: EpisodeResults
    with_them: EpisodeResults


def played(task: str, seed: int, preset: str, *, ahead: bool) -> EpisodeResults:
    """One episode with the nominal model, from the truth with the noise of particles from images."""
    model = worker_api.nominal_model(task)
    config = EvaluationConfig(
        task=load(task), preset=preset, seed=seed, method=DIPAC, model=model, eyes="truth", ahead=ahead
    )
    return play(config, site=Site())


def row(task: str, pairs: list[Pair]) -> list[str]:
    """Successes and actions without and with, the share of later decisions taken, and median seconds of both kinds."""
    ways = [[pair.without for pair in pairs], [pair.with_them for pair in pairs]]
    kinds = [(kept, s) for each in ways[1] for kept, s in list(zip(each.ahead, each.decision_s, strict=True))[1:]]
    taken = [s for kept, s in kinds if kept]
    anew = [s for each in ways[0] for s in each.decision_s[1:]]
    return [
        task,
        *(f"{sum(each.success for each in way)} of {len(way)}" for way in ways),
        *(f"{np.mean([len(each.decision_s) for each in way]):.1f}" for way in ways),
        f"{len(taken)} of {len(kinds)}",
        f"{np.median(taken):.2f} s" if taken else "-",
        f"{np.median(anew):.2f} s" if anew else "-",
    ]


def main(
    tasks: Annotated[tuple[str, ...], tyro.conf.arg(help="Full names.")] = ("rope_push@rods", "rod_to_rope@rods"),
    seeds: Annotated[int, tyro.conf.arg(help="Problems of each, from 0 on.")] = 10,
    preset: Literal["auto", "cpu", "gpu"] = "auto",
) -> None:
    """Play every problem both ways in lock step, and print a table."""
    head = ("task", "success", "with", "actions", "with", "taken", "a decision taken", "anew")
    size = preset if preset != "auto" else choose_preset()
    rows = list[list[str]]()
    for task in tasks:
        pairs = list[Pair]()
        for seed in range(seeds):
            without, with_them = (played(task, seed, size, ahead=ahead) for ahead in (False, True))
            pairs.append(Pair(without=without, with_them=with_them))
            print(task, seed, *row(task, pairs[-1:])[1:], flush=True)
        rows.append(row(task, pairs))
    print("\n".join("| " + " | ".join(each) + " |" for each in [list(head), ["---"] * len(head), *rows]))


if __name__ == "__main__":
    tyro.cli(main)
