"""Recordings in which the arm errs, one error each, and one without, and what is concluded from them, side by side."""

import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeAlias, TypeVar

from bench.hidden.draws import Chosen
from bench.hidden.verdicts import Verdict
from tests.hidden.kept import Case, concluded

Verdicts: TypeAlias = Mapping[str, Future[Verdict]]
CaseT = TypeVar("CaseT", bound=Case)

ARM = ("actuator_lag", "command_delay", "tcp_offset", "under_reach")
NOTHING = "nothing"
SIZE = 1.25
"""Hidden size, in typical ones."""


def cases(make: Callable[[int, tuple[Chosen, ...]], CaseT], *, first_seed: int) -> dict[str, CaseT]:
    """A case of each error, and of nothing; `make`: of a seed and what is hidden."""
    hidden = {name: (Chosen(effect=name, size=SIZE),) for name in ARM} | {NOTHING: ()}
    return {name: make(first_seed + number, each) for number, (name, each) in enumerate(hidden.items())}


def concluding(made: Mapping[str, Case]) -> Iterator[Verdicts]:
    """The verdicts of all cases, as many at a time as there are cores; those not begun are left when it ends."""
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        yield {name: pool.submit(concluded, case) for name, case in made.items()}
        pool.shutdown(cancel_futures=True)
