"""One small recording each of ten kinds and two controls, each of which `dipac discover` must be right about.

The solver is a process of its own in a folder with the recordings alone, as in `dipac bench discovery`, and there is
nothing about it that a user would not have.
"""

import os
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import pytest

from app.policy.strokes import Plan
from bench.hidden.draws import Case, Chosen
from bench.hidden.outcome import Outcome, outcome
from bench.hidden.scores import alarming
from bench.hidden.trial import Setup, tried

# The whole chain takes a quarter of an hour of processor time for the twelve pushes of one of these recordings.
pytestmark = [pytest.mark.slow, pytest.mark.timeout(4 * 3600)]

SETUP = Setup(seed=0, plan=Plan(episodes=4, pushes=3), oracle=False, deadline_s=3600.0)
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

CASES = {
    f"{world}-{kind}": Case(number=number, world=world, hidden=(Chosen(effect=kind, size=size),))
    for world, kind, size, number in HIDDEN
} | {f"{world}-control-{number}": Case(number=number, world=world, hidden=()) for world, number in CONTROLS}


@pytest.fixture(scope="module")
def trials() -> Iterator[dict[str, Future[dict[str, Any]]]]:
    """All cases, as many at a time as there are cores."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        yield {name: pool.submit(tried, case, SETUP) for name, case in CASES.items()}
        pool.shutdown(cancel_futures=True)


def concluded(trials: dict[str, Future[dict[str, Any]]], name: str) -> Outcome:
    line = trials[name].result()
    assert "failure" not in line, line["failure"]
    return outcome(line)


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.hidden])
def test_what_is_hidden_is_named(trials: dict[str, Future[dict[str, Any]]], name: str) -> None:
    made = concluded(trials, name)
    assert made.named == tuple(made.hidden)


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if not case.hidden])
def test_where_nothing_is_hidden_nothing_is_missing(trials: dict[str, Future[dict[str, Any]]], name: str) -> None:
    assert not alarming(concluded(trials, name))
