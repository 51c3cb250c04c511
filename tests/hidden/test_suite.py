"""One small recording each of ten kinds and two controls, each of which `dipac discover` must be right about.

The solver is a process of its own in a folder with the recordings alone, as in `dipac bench discovery`, and there is
nothing about it that a user would not have. Ropes are rods, as by default; a few cases are of material points.
"""

import os
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import pytest

from app.policy.random_pushes import PushDesign
from bench.hidden.draws import Case, Chosen, Making
from bench.hidden.outcome import Outcome, outcome
from bench.hidden.scores import alarming
from bench.hidden.trial import Setup, tried

# A case is made and judged by processes of its own, in a minute or two of two cores, of material points in fifteen.
pytestmark = [pytest.mark.slow, pytest.mark.timeout(4 * 3600)]

SETUP = Setup(seed=0, plan=PushDesign(episodes=4, pushes=3), oracle=False, deadline_s=3600.0)
HIDDEN = (
    # World, kind, size in typical ones, number: it draws signs, directions, places and pushes.
    ("own", "command_delay", 1.0, 1),
    ("own", "actuator_lag", 1.0, 2),
    ("own", "under_reach", 1.5, 3),
    ("own", "backlash", 1.5, 4),
    ("own", "hand_eye_translation", 1.5, 5),
    ("own", "tcp_offset", 1.5, 6),
    ("own", "depth_scale", 2.0, 7),
    ("own", "camera_time_offset", 1.5, 8),
    ("mujoco", "command_delay", 1.0, 9),
    ("mujoco", "hand_eye_translation", 1.5, 10),
)
CONTROLS = (("own", 11), ("own", 12))
POINTS = Setup(seed=0, plan=SETUP.plan, oracle=False, deadline_s=SETUP.deadline_s, making=Making(dynamics="mpm"))
OF_POINTS = ("own-command_delay", "own-control-11")
"""Cases of which material points are asked, too."""

CASES = {
    f"{world}-{kind}": Case(number=number, world=world, hidden=(Chosen(effect=kind, size=size),))
    for world, kind, size, number in HIDDEN
} | {f"{world}-control-{number}": Case(number=number, world=world, hidden=()) for world, number in CONTROLS}


@pytest.fixture(scope="module")
def trials() -> Iterator[dict[str, Future[dict[str, Any]]]]:
    """All cases, as many at a time as there are cores."""
    asked = {name: (case, SETUP) for name, case in CASES.items()}
    asked |= {f"{name}-mpm": (CASES[name], POINTS) for name in OF_POINTS}
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        yield {name: pool.submit(tried, *each) for name, each in asked.items()}
        pool.shutdown(cancel_futures=True)


def concluded(trials: dict[str, Future[dict[str, Any]]], name: str) -> Outcome:
    line = trials[name].result()
    assert "failure" not in line, line["failure"]
    return outcome(line)


def names(*, hidden: bool) -> list[str]:
    """Cases with something hidden, or without."""
    chosen = [name for name, case in CASES.items() if bool(case.hidden) == hidden]
    chosen += [f"{name}-mpm" for name in OF_POINTS if name in chosen]
    return chosen


@pytest.mark.parametrize("name", names(hidden=True))
def test_what_is_hidden_is_named(trials: dict[str, Future[dict[str, Any]]], name: str) -> None:
    made = concluded(trials, name)
    assert made.named == tuple(made.hidden)


@pytest.mark.parametrize("name", names(hidden=False))
def test_where_nothing_is_hidden_nothing_is_missing(trials: dict[str, Future[dict[str, Any]]], name: str) -> None:
    assert not alarming(concluded(trials, name))


def test_an_oracle_and_other_methods_are_asked_about_the_same_recordings() -> None:
    case = Case(number=20, world="mujoco", hidden=(Chosen(effect="under_reach", size=2.0),))
    light = replace(SETUP, oracle=True, baselines=True, making=Making(images=False))
    line = tried(case, light)
    assert "failure" not in line, line["failure"]
    asked = line["oracle"]
    assert 0 < asked["extended"] < asked["nominal"]
    assert line["spent"]["peak_mb"] > 100
    ranked = {cause["effect"] for cause in line["verdict"]["ranking"]}
    for verdict in line["baselines"].values():
        assert {cause["effect"] for cause in verdict["ranking"]} == ranked
    # The other one blames what is largest when all parameters are fitted at once, here a tilt of the table.
    assert outcome(line | {"verdict": line["baselines"]["bic"]}).first == "under_reach"
