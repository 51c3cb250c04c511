"""Five recordings of beans in MuJoCo's world: what the arm gets wrong is named, and where nothing is hidden nothing is.

What is hidden, its size and what is asked were fixed before the solver saw them. A case takes minutes of a core, as
every sweep is simulated from four beginnings.
"""

from collections.abc import Iterator

import pytest

from app.policy.random_sweeps import sweep_design
from bench.hidden.beans import BeanCase
from tests.hidden.arm_errors import ARM, NOTHING, Verdicts, cases, concluding

pytestmark = [pytest.mark.slow, pytest.mark.serial, pytest.mark.timeout(1800)]

CASES = cases(lambda seed, hidden: BeanCase(seed=seed, hidden=hidden, plan=sweep_design(3, 2)), first_seed=4100)


@pytest.fixture(scope="module")
def verdicts() -> Iterator[Verdicts]:
    yield from concluding(CASES)


@pytest.mark.parametrize("name", ARM)
def test_what_the_arm_gets_wrong_in_sweeps_is_named(verdicts: Verdicts, name: str) -> None:
    said = verdicts[name].result()
    assert (said.kind, said.causes) == ("named", (name,))


def test_where_nothing_is_hidden_in_sweeps_nothing_is_named(verdicts: Verdicts) -> None:
    assert verdicts[NOTHING].result().kind in ("none", "set")
