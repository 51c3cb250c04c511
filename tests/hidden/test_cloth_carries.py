"""Five recordings of a carried cloth in MuJoCo's world: what the arm gets wrong is named, and of nothing nothing.

What is hidden, its size and what is asked were fixed before the solver saw them. Making and reading a case take minutes
of a core each.
"""

from collections.abc import Iterator

import pytest

from app.policy.random_carries import carry_design
from bench.hidden.cloths import ClothCase
from tests.hidden.arm_errors import ARM, NOTHING, Verdicts, cases, concluding

pytestmark = [pytest.mark.slow, pytest.mark.serial, pytest.mark.timeout(3600)]

CASES = cases(lambda seed, hidden: ClothCase(seed=seed, hidden=hidden, plan=carry_design(3, 3)), first_seed=4200)


@pytest.fixture(scope="module")
def verdicts() -> Iterator[Verdicts]:
    yield from concluding(CASES)


@pytest.mark.parametrize("name", ARM)
def test_what_the_arm_gets_wrong_in_carries_is_named(verdicts: Verdicts, name: str) -> None:
    said = verdicts[name].result()
    assert (said.kind, said.causes) == ("named", (name,))


def test_where_nothing_is_hidden_in_carries_nothing_is_named(verdicts: Verdicts) -> None:
    assert verdicts[NOTHING].result().kind in ("none", "set")
