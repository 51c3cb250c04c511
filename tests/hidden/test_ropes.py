"""Twenty-four ropes, each simulated in another process: a hidden effect has to be found, or nothing is named.

The world is MuJoCo's chain; rope, finger, frictions and noise are drawn anew for each. The hidden effects and the
questions were fixed before any solver saw them. Errors of cameras alone cannot be hidden where there are no images.
"""

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import pytest

from app.policy.random_pushes import PushDesign
from bench.hidden.draws import Chosen
from bench.hidden.ropes import RopeCase
from bench.hidden.verdicts import Verdict
from tests.hidden.kept import concluded

pytestmark = [pytest.mark.serial, pytest.mark.timeout(1800)]

PLAN = PushDesign(episodes=5, pushes=4)
SIZE = 1.25
PHYSICS = (
    "abrupt_change",
    "finger_friction",
    "friction_anisotropy",
    "friction_map",
    "hidden_obstacle",
    "mass_heterogeneity",
    "point_attraction",
    "stiffness_heterogeneity",
    "stribeck",
    "table_tilt",
)
ARM = ("actuator_lag", "backlash", "tcp_offset", "under_reach")
PAIRS = (("backlash", "friction_anisotropy"), ("friction_map", "tcp_offset"))
OUTSIDE = ("swirl", "quadratic_drag")
CONTROLS = 6
HIDDEN = (*((name,) for name in (*PHYSICS, *ARM)), *PAIRS, *((name,) for name in OUTSIDE), *((),) * CONTROLS)
CASES = {
    f"{number:02d}-{'+'.join(names) or 'nothing'}": RopeCase(
        seed=4000 + number, hidden=tuple(Chosen(effect=name, size=SIZE) for name in names), plan=PLAN
    )
    for number, names in enumerate(HIDDEN)
}
OFTEN = [name for name in CASES if name.split("-")[0] in ("11", "12", "18", "19")]
"""Cases of every `make test`; `make test-slow` runs all: a case takes three quarters of a minute of a core."""
LIKE = {"draught": "table_tilt"}
"""Causes that count as others: without a look at the table, a draught cannot be told from a tilt."""
SURE = 0.8


@pytest.fixture(scope="module")
def verdicts(request: pytest.FixtureRequest) -> Iterator[dict[str, Future[Verdict]]]:
    """Verdicts on all cases if any of the slow tests runs, else on a few."""
    own = [item for item in request.session.items if item.path == request.path]
    wanted = CASES if any(item.get_closest_marker("slow") for item in own) else OFTEN
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        yield {name: pool.submit(concluded, CASES[name]) for name in wanted}
        pool.shutdown(cancel_futures=True)


def cases(names: Sequence[str]) -> list[Any]:
    """Parameters of a test; those that are not looked at in every run are slow."""
    return [pytest.param(name, marks=() if name in OFTEN else pytest.mark.slow) for name in names]


def right(case: RopeCase, said: Verdict) -> bool:
    hidden = {LIKE.get(each.effect, each.effect) for each in case.hidden}
    return bool(said.causes) and {LIKE.get(name, name) for name in said.causes} <= hidden


def named(said: Verdict) -> bool:
    return said.kind == "named" and all(said.probabilities[name] > SURE for name in said.causes[:1])


@pytest.mark.parametrize("name", cases([name for name, case in CASES.items() if not case.hidden]))
def test_where_nothing_is_hidden_nothing_is_named(verdicts: dict[str, Future[Verdict]], name: str) -> None:
    assert verdicts[name].result().kind in ("none", "set")


@pytest.mark.parametrize("name", cases([name for name in CASES if name.split("-")[1] in ARM]))
def test_what_the_arm_gets_wrong_is_named(verdicts: dict[str, Future[Verdict]], name: str) -> None:
    said = verdicts[name].result()
    assert said.kind == "named"
    assert right(CASES[name], said)


@pytest.mark.slow
def test_of_all_at_most_one_is_named_wrongly(verdicts: dict[str, Future[Verdict]]) -> None:
    said = {name: verdicts[name].result() for name in CASES}
    wrong = [name for name, each in said.items() if named(each) and not right(CASES[name], each)]
    assert len(wrong) <= 1, wrong


@pytest.mark.slow
@pytest.mark.xfail(reason="Physics of ropes is rarely named in twenty pushes: docs/discovery.md")
def test_three_of_four_effects_of_physics_are_named(verdicts: dict[str, Future[Verdict]]) -> None:
    own = [name for name, case in CASES.items() if case.hidden and name.split("-")[1] in PHYSICS]
    found = [name for name in own if named(said := verdicts[name].result()) and right(CASES[name], said)]
    assert len(found) >= 0.75 * len(own), found
