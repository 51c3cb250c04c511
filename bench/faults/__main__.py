"""Every fault many times over, several applications at once: `python -m bench.faults [TIMES]`."""

import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from rich.console import Console
from rich.table import Table

from app.config import Site
from app.core.motion import pointing_down
from app.rig.simulated.arm_control import ArmControl
from bench.faults.application import FAULTS, Doing
from bench.faults.inject import Outcome, faults, subject

_TIMES = 8
_AT_ONCE = 3


def suffered(doing: Doing) -> list[Outcome]:
    """What came of every fault in turn, done to one application."""
    take = partial(ArmControl, tool=pointing_down(np.array([0.45, 0.0, 0.10])))
    with subject(doing, Site(), take) as one:
        return [one.suffer(fault) for fault in faults(doing)]


def every(times: int, at_once: int = _AT_ONCE) -> list[Outcome]:
    """Every fault in every situation, so many times each."""
    rounds = [doing for doing in FAULTS for _ in range(times)]
    with ThreadPoolExecutor(at_once) as pool:
        return [outcome for found in pool.map(suffered, rounds) for outcome in found]


def table(outcomes: Sequence[Outcome]) -> Table:
    """A row a fault and situation."""
    rows = Table(title=f"{len(outcomes)} faults while the arm moves: from the fault to rest, in its own clock [ms]")
    for column in ("fault", "meanwhile", "times", "median", "longest", "outside limits"):
        rows.add_column(column, justify="left" if column in ("fault", "meanwhile") else "right")
    for doing, fault in dict.fromkeys((each.doing, each.fault) for each in outcomes):
        found = [each for each in outcomes if (each.doing, each.fault) == (doing, fault)]
        rest = [each.rest_ms for each in found]
        outside = sum(not each.within for each in found)
        rows.add_row(fault, doing, str(len(found)), f"{np.median(rest):.0f}", f"{max(rest):.0f}", str(outside))
    return rows


def main(arguments: Sequence[str]) -> None:
    """Print the table."""
    Console().print(table(every(int(arguments[0]) if arguments else _TIMES)))


if __name__ == "__main__":
    main(sys.argv[1:])
