"""Known errors in recordings that are right, named back: `python -m bench.half_real lines.jsonl --studies 40`.

Recordings of pushes in which nothing is hidden are kept as they are, or made as if cameras or arm had erred by a known
amount (`bench.hidden.known_errors`), and go through discovery. Each line of the file is one verdict; what is done is
not done again, so that an interrupted run goes on. Without `--studies` the table of what is there is printed.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Final, final

import numpy as np
import tyro
from jaxtyping import Float64
from rich.console import Console
from rich.table import Table

from app.discovery.dataset.study import Study
from app.evaluation.intervals import share
from app.evaluation.results_log import lines
from app.jobs.discovery_subject import subject_of
from app.policy.random_pushes import PushDesign
from bench.hidden.known_errors import effect_of, with_error
from bench.hidden.ropes import RopeCase
from bench.hidden.verdicts import Verdict, verdict_on

PLAN: Final = PushDesign(episodes=5, pushes=4)
FIRST_SEED: Final = 7100
"""First seed of the recordings: other ones than confidence was learnt from, or tests use."""
TYPICAL: Final = (1.0, -1.25, 1.5, -1.75, 2.0, -1.0)
"""Sizes by recording, in typical ones; of what cannot be negative without the sign."""
ERRORS: Final = (
    "tcp_offset",
    "hand_eye_translation",
    "command_delay",
    "depth_scale",
    "mask_erosion",
)
MORE: Final = ("camera_time_offset", "backlash")
LARGE: Final = (("tcp_offset", 0.008), ("tcp_offset", 0.015), ("hand_eye_translation", 0.008), ("depth_scale", 0.02))
"""Sizes that are asked about besides, in the parameter's own unit."""
NOTHING: Final = ""
_SURE: Final = 0.8
_DIRECTIONS: Final = 3
"""Stream of random numbers of a seed."""


@final
@dataclass(frozen=True, kw_only=True)
class Order:
    """A study: recording, injected error, and its size in typical ones, or `own` in its own unit."""

    recording: int
    effect: str = NOTHING
    typical: float | None = None
    own: float | None = None

    @property
    def key(self) -> str:
        """Its name in a file of results."""
        return f"{self.recording}-{self.effect}-{self.typical}-{self.own}"

    def values(self) -> Float64[np.ndarray, " V"]:
        """Values of the effect's parameters; a vector has a random direction."""
        specs = effect_of(self.effect).parameters
        size = self.own if self.own is not None else (self.typical or 0.0) * float(specs[0].typical or 0.0)
        if specs[0].low >= 0:
            size = abs(size)
        if len(specs) == 1:
            return np.array([size])
        rng = np.random.default_rng([FIRST_SEED + self.recording, _DIRECTIONS])
        way = rng.normal(size=len(specs))
        return size * way / np.linalg.norm(way)


def orders(recordings: int) -> Iterator[Order]:
    """All studies: typical errors first, recording by recording, then the rest."""
    for recording in range(recordings):
        yield Order(recording=recording)
        size = TYPICAL[recording % len(TYPICAL)]
        for effect in ERRORS:
            yield Order(recording=recording, effect=effect, typical=size)
    for recording in range(recordings):
        size = TYPICAL[recording % len(TYPICAL)]
        for effect in MORE:
            yield Order(recording=recording, effect=effect, typical=size)
        for effect, own in LARGE:
            yield Order(recording=recording, effect=effect, own=own * (-1) ** recording)


@cache
def recorded(recording: int) -> tuple[RopeCase, Study]:
    """A recording of the rehearsal rig in which nothing is hidden."""
    case = RopeCase(seed=FIRST_SEED + recording, plan=PLAN)
    return case, case.record()


def line_of(order: Order) -> dict[str, Any]:
    """Line of results of discovery for an order."""
    case, study = recorded(order.recording)
    values = order.values() if order.effect else np.zeros(0)
    made = with_error(study, order.effect, values) if order.effect else study
    return {"key": order.key, **described(order.effect, values, verdict_on(made, subject_of(case.task)))}


def described(effect: str, values: Float64[np.ndarray, " V"], said: Verdict) -> dict[str, Any]:
    """A verdict beside the truth, as a line of a file."""
    ranked = sorted(said.probabilities.items(), key=lambda pair: -pair[1])
    return {
        "effect": effect,
        "values": np.round(values, 6).tolist(),
        "kind": said.kind,
        "causes": list(said.causes),
        "ranking": [[name, round(probability, 4)] for name, probability in ranked[:3]],
        "sizes": [[it.value, it.low, it.high] for it in said.sizes.get(effect, ())],
    }


def outcome_of(line: dict[str, Any]) -> str:
    """Outcome of a study: `named` the truth above 0.8, `first` but not sure, `wrong` named above 0.8, or `silent`."""
    first, probability = line["ranking"][0]
    right = first == line["effect"]
    if line["kind"] == "named" and probability > _SURE:
        return "named" if right and line["causes"] == [first] else "wrong"
    return "first" if right else "silent"


def summary(known: Sequence[dict[str, Any]], title: str) -> Table:
    """Counts by effect, with Wilson's 95 % interval of what was named; medians of errors of refitted sizes."""
    table = Table(title=title)
    for heading in (
        "put in",
        "size",
        "n",
        "named (95 %)",
        "first, unsure",
        "silent",
        "wrong",
        "size off, median",
        "in 90 %",
    ):
        table.add_column(heading)
    groups = dict[tuple[str, str], list[dict[str, Any]]]()
    for line in known:
        groups.setdefault((line["effect"], _sized(line)), []).append(line)
    for (effect, size), own in sorted(groups.items()):
        said = [outcome_of(line) for line in own]
        rate = share([each == "named" for each in said])
        off, covered = _off(own)
        table.add_row(
            effect or "nothing",
            size,
            str(len(own)),
            f"{said.count('named')} ({rate.low:.2f} to {rate.high:.2f})" if effect else "",
            str(said.count("first")) if effect else "",
            str(said.count("silent")),
            str(said.count("wrong")),
            off,
            covered,
        )
    return table


def _sized(line: dict[str, Any]) -> str:
    """Size of the injected error as text, in typical sizes or in its own unit."""
    if not line["effect"]:
        return ""
    spec = effect_of(line["effect"]).parameters[0]
    size = float(np.linalg.norm(line["values"]))
    for effect, own in LARGE:
        if effect == line["effect"] and abs(size - own) < 1e-6:
            return f"{1e3 * own:g} mm" if spec.unit == "m" else f"{own:g} {spec.unit}"
    return "1 to 2 typical"


def _off(own: Sequence[dict[str, Any]]) -> tuple[str, str]:
    """Relative errors of sizes that were refitted, and how many parameters lie in their 90 % intervals."""
    errors, inside = list[float](), list[bool]()
    for line in own:
        if line["sizes"]:
            value, low, high = np.array(line["sizes"]).T
            true = np.array(line["values"])
            errors.append(float(np.linalg.norm(value - true) / np.linalg.norm(true)))
            inside += ((low <= true) & (true <= high)).tolist()
    return (f"{np.median(errors):.0%}", f"{sum(inside)} of {len(inside)}") if errors else ("", "")


def main(
    path: tyro.conf.Positional[Path],
    /,
    *,
    studies: Annotated[int, tyro.conf.arg(help="to have at the end, in the order of `orders`")] = 0,
    recordings: Annotated[int, tyro.conf.arg(help="of 20 pushes each")] = len(TYPICAL),
) -> None:
    """Run the missing studies, a minute of a core each, and print the table."""
    known = {line["key"]: line for line in lines(path)} if path.exists() else dict[str, dict[str, Any]]()
    with path.open("a", encoding="utf-8") as file:
        for order in list(orders(recordings))[:studies]:
            if order.key not in known:
                known[order.key] = line_of(order)
                file.write(json.dumps(known[order.key]) + "\n")
                file.flush()
    Console(width=140).print(summary(list(known.values()), "Errors that were put into recordings of the rehearsal rig"))


if __name__ == "__main__":
    tyro.cli(main)
