"""Whatever goes wrong in the whole application, the arm rests, the log is whole, and it goes on or says what to do."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from app.core.dialogue.control import MODES, ModeName
from bench.faults.injections import KINDS, Kind, kinds
from bench.faults.suffered import Came, sequence

SOME: tuple[tuple[ModeName, tuple[str, ...]], ...] = (
    ("automatic", ("kill planner", "hang application", "plans: nan", "particles: nan", "kill application")),
    ("teleoperate", ("the page is gone", "flood of decisions", "cameras show nan", "the disk is full")),
)
"""One application each, from fault to fault; the last one ends it."""
CALIBRATING = "--calibrating"


def wrong(came: list[Came]) -> list[str]:
    return [f"{it.mode}, {it.kind.name}: {', '.join(it.wrong)}" for it in came if it.wrong]


def some(mode: ModeName, names: tuple[str, ...]) -> list[Came]:
    found = {kind.name: kind for kind in kinds(mode)}
    return sequence(mode, [found[name] for name in names])


@pytest.mark.serial
def test_after_a_fault_the_arm_rests_the_log_is_whole_and_the_application_goes_on_or_says_what_to_do() -> None:
    with ThreadPoolExecutor(len(SOME)) as pool:
        came = [it for each in pool.map(some, *zip(*SOME, strict=True)) for it in each]
    assert len(came) == sum(len(names) for _, names in SOME)
    assert wrong(came) == []


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("mode", MODES)
def test_so_it_is_after_every_fault_that_an_application_survives(mode: ModeName) -> None:
    survived = [kind for kind in kinds(mode) if not kind.ends]
    came = sequence(mode, survived, CALIBRATING)
    assert len(came) == len(survived)
    assert wrong(came) == []


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind.ends], ids=lambda kind: kind.name)
def test_so_it_is_after_every_fault_that_ends_it(kind: Kind, mode: ModeName) -> None:
    assert wrong(sequence(mode, [kind])) == []
