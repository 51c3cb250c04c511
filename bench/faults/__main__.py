"""Repeated injection of every fault, into several applications at once.

`python -m bench.faults [TIMES]`: at the arm; `python -m bench.faults whole [MODE...]`: in the whole application.
"""

import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from rich.console import Console
from rich.table import Table

from app.config import Site
from app.core.dialogue.control import MODES, ModeName
from app.core.motion import pointing_down
from app.rig.simulated.arm_control import ArmControl
from bench.faults.application import FAULTS, Doing
from bench.faults.inject import Outcome, faults, subject
from bench.faults.injections import in_turn
from bench.faults.suffered import sequence

_TIMES = 8
_AT_ONCE = 3


def suffered(doing: Doing) -> list[Outcome]:
    """Outcomes of all faults in turn, injected into one application."""
    take = partial(ArmControl, tool=pointing_down(np.array([0.45, 0.0, 0.10])))
    with subject(doing, Site(), take) as one:
        return [one.suffer(fault) for fault in faults(doing)]


def every(times: int, at_once: int = _AT_ONCE) -> list[Outcome]:
    """Outcomes of every fault in every situation, repeated."""
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


def whole(modes: Sequence[ModeName]) -> None:
    """Print the outcomes of every fault in the whole application, one application after the other."""
    came = [
        each
        for mode in modes
        for faults_in_turn in in_turn(mode)
        for each in sequence(mode, faults_in_turn, "--calibrating")
    ]
    rows = Table(title=f"{len(came)} faults in the whole application")
    for column in ("fault", "mode", "at rest [ms]", "log lacks [s]", "then", "wrong"):
        rows.add_column(column)
    for each in came:
        rest = f"{each.rest_ms:.0f}" if each.kind.silences else ""
        then = "goes on" if each.went_on else each.says
        rows.add_row(each.kind.name, each.mode, rest, f"{each.log_s:.2f}", then, "; ".join(each.wrong))
    Console(width=200).print(rows)


def main(arguments: Sequence[str]) -> None:
    """Print the table."""
    if arguments and arguments[0] == "whole":
        whole([mode for mode in MODES if mode in arguments[1:] or not arguments[1:]])
        return
    Console().print(table(every(int(arguments[0]) if arguments else _TIMES)))


if __name__ == "__main__":
    main(sys.argv[1:])
