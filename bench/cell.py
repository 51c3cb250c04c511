"""The whole cell, from camera images to executed pushes: ten seeds of `dipac run`, each a process of its own.

`python -m bench.cell --seeds 10 -o DIR` keeps one JSON file and one recording a seed in DIR and goes on where it was
interrupted. The default DIR is named after the version of the code, so that no seed of another version is counted; the
versions of uncommitted changes look alike, so commit before measuring. `--world cable` has the other rope.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any, get_args

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from app.commands._episode import code_version
from app.core.errors import DipacError
from app.core.geometry.scene_description import RopeModel
from app.core.messages import ArmState, Particles
from app.recording.read.reader import read_messages

_DEADLINE_S = 1800
_OPENING = 1
"""The recorder itself writes the episode's opening message."""


def main(options: Sequence[str] = ()) -> None:
    given = _given(options)
    folder = given.output or Path(".cache/bench-cell") / f"{code_version()}-{given.world}"
    folder.mkdir(parents=True, exist_ok=True)
    _print([_episode(seed, given, folder) for seed in range(given.seeds)])


def _given(options: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--pushes", type=int, default=10)
    parser.add_argument("--world", choices=get_args(RopeModel), default="chain")
    parser.add_argument("-o", "--output", type=Path)
    return parser.parse_args(list(options))


def _episode(seed: int, given: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """The outcome of one seed, run unless it is there; where it failed, the seed and why, under `failure`."""
    outcome = folder / f"seed{seed}.json"
    try:
        if not outcome.exists():
            _run(seed, given, outcome)
        row = json.loads(outcome.read_text())
        failure = _failure(row)
        return {"seed": seed, "failure": failure} if failure else row | _measured(row, folder)
    except (OSError, ValueError, DipacError, subprocess.TimeoutExpired) as error:
        return {"seed": seed, "failure": str(error)}


def _run(seed: int, given: argparse.Namespace, outcome: Path) -> None:
    print(f"seed {seed} ...", flush=True)
    subprocess.run(
        [
            *(sys.executable, "-m", "app", "run", "rope_push", "--preset", "cpu", "--port", "0"),
            *("--seed", str(seed), "--pushes", str(given.pushes), "--world", given.world),
            *("--json", str(outcome), "--recordings", str(outcome.parent)),
        ],
        check=False,
        timeout=_DEADLINE_S,
    )


def _failure(row: dict[str, Any]) -> str | None:
    """Why an episode does not count, None where it does."""
    if row["failure"]:
        return row["failure"]
    return None if row["decision_s"] and row["first_push_s"] is not None else "no push was finished"


def _measured(row: dict[str, Any], folder: Path) -> dict[str, list[float]]:
    """Times in the recording [s]: the arm's longest control period in every half second, and frames to particles."""
    recording = Path(row["recording"])
    messages = list(read_messages(recording if recording.exists() else folder / recording.name, [ArmState, Particles]))
    return {
        "arm_period_s": [message.period_s for message in messages if isinstance(message, ArmState)],
        "frames_to_particles_s": [message.reconstruction_s for message in messages if isinstance(message, Particles)],
    }


def _print(rows: list[dict[str, Any]]) -> None:
    output = Console(width=120)
    failed = [row for row in rows if row["failure"]]
    finished = [row for row in rows if not row["failure"]]
    output.print(_episodes(finished))
    for row in failed:
        output.print(Text(f"seed {row['seed']} failed: {row['failure']}", "red"))
    output.print(f"{len(failed)} of {len(rows)} seeds failed; the measures are of the others.")
    if finished:
        output.print(_measures(finished))


def _episodes(rows: list[dict[str, Any]]) -> Table:
    table = Table(
        "seed", "pushes", "Chamfer start", "end [mm]", "end/start", "decision [s]", "descent", "first push", "faults"
    )
    for row in rows:
        chamfer = row["chamfer_m2"]
        better = [after < before for before, after in zip(row["cost_before"], row["cost_after"], strict=True)]
        table.add_row(
            str(row["seed"]),
            str(len(chamfer) - 1),
            f"{_mm(chamfer[0]):.1f}",
            f"{_mm(chamfer[-1]):.1f}",
            f"{chamfer[-1] / chamfer[0]:.2f}",
            f"{median(row['decision_s']):.1f} / {max(row['decision_s']):.1f}",
            f"{sum(better)}/{len(better)}",
            f"{row['first_push_s']:.0f} s",
            str(len(row["faults"])),
        )
    return table


def _measures(rows: list[dict[str, Any]]) -> Table:
    ratios = [row["chamfer_m2"][-1] / row["chamfer_m2"][0] for row in rows]
    decisions = _all(rows, "decision_s")
    descents = [a < b for row in rows for b, a in zip(row["cost_before"], row["cost_after"], strict=True)]
    measures = Table("measure", "value")
    for name, value in (
        ("median final/initial Chamfer", f"{median(ratios):.3f}"),
        ("episodes that improved", f"{sum(r < 1 for r in ratios)} of {len(rows)}"),
        ("episodes without a fault", f"{sum(not row['faults'] for row in rows)} of {len(rows)}"),
        ("decisions with cost after descent below before", f"{sum(descents)} of {len(descents)}"),
        ("decision, median / p99 / longest", _spread(decisions, 1.0, "s")),
        ("first push, longest", f"{max(row['first_push_s'] for row in rows):.0f} s"),
        ("frames to particles, median / p99 / longest", _spread(_all(rows, "frames_to_particles_s"), 1e3, "ms")),
        ("exposure to particles, median / p99 / longest", _spread(_all(rows, "reconstruction_latency_s"), 1e3, "ms")),
        (
            "arm period, longest in each half second: median / p99 / longest",
            _spread(_all(rows, "arm_period_s"), 1e3, "ms"),
        ),
        ("messages said but not recorded", str(sum(row["said"] + _OPENING - row["recorded"] for row in rows))),
    ):
        measures.add_row(name, value)
    return measures


def _all(rows: list[dict[str, Any]], key: str) -> list[float]:
    return [value for row in rows for value in row[key]]


def _spread(values: list[float], scale: float, unit: str) -> str:
    return (
        f"{scale * np.median(values):.1f} / {scale * np.quantile(values, 0.99):.1f} / {scale * max(values):.1f} {unit}"
    )


def _mm(chamfer_m2: float) -> float:
    return 1e3 * (chamfer_m2 / 2) ** 0.5


if __name__ == "__main__":
    main(sys.argv[1:])
