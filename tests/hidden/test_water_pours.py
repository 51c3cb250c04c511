"""Five recordings of water in the cell's world: the arm's errors are named, and where nothing is hidden nothing is.

What is hidden, its size and what is asked were fixed before the solver saw them. A case takes minutes of a core.
"""

import os
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import get_context

import pytest

from app.policy.random_pours import pour_design
from bench.hidden.draws import Chosen
from bench.hidden.verdicts import Verdict
from bench.hidden.water import WaterCase
from tests.hidden.kept import concluded

pytestmark = [pytest.mark.slow, pytest.mark.serial, pytest.mark.timeout(3600)]

ARM = ("actuator_lag", "command_delay", "tcp_offset", "under_reach")
SIZE = 1.25
CASES = {
    name: WaterCase(
        seed=4200 + number,
        hidden=() if name == "nothing" else (Chosen(effect=name, size=SIZE),),
        plan=pour_design(4, 3),
    )
    for number, name in enumerate((*ARM, "nothing"))
}


@pytest.fixture(scope="module")
def verdicts() -> Iterator[dict[str, Future[Verdict]]]:
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        yield {name: pool.submit(concluded, case) for name, case in CASES.items()}
        pool.shutdown(cancel_futures=True)


@pytest.mark.parametrize("name", ARM)
def test_what_the_arm_gets_wrong_in_pours_is_named(verdicts: dict[str, Future[Verdict]], name: str) -> None:
    said = verdicts[name].result()
    assert (said.kind, said.causes) == ("named", (name,))


def test_where_nothing_is_hidden_in_pours_nothing_is_named(verdicts: dict[str, Future[Verdict]]) -> None:
    assert verdicts["nothing"].result().kind in ("none", "set")
