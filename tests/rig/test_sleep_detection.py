"""A costly world sleeps while nothing happens, and wakes when its tool moves."""

import numpy as np
import pytest

from app.rig.simulated.kinds import kind_of
from app.rig.simulated.worlds.sleep_detection import Rest
from app.tasks import load

HERE = np.array([0.3, 0.0, 0.3])


def watched(speed_m_s: float, *, seconds: float) -> Rest:
    rest, x = Rest(), np.zeros((200, 3))
    for _ in range(round(seconds / 0.1)):
        rest.lasts(HERE, HERE)
        rest.watch(x, x + 0.1 * np.array([speed_m_s, 0.0, 0.0]), 0.1)
    return rest


def test_what_is_still_for_a_while_sleeps_until_the_tool_moves() -> None:
    rest = watched(0.001, seconds=0.5)
    assert rest.lasts(HERE, HERE)
    assert not rest.lasts(HERE, HERE + 0.001)
    assert not rest.lasts(HERE, HERE)


@pytest.mark.parametrize(("speed_m_s", "seconds"), [(0.02, 1.0), (0.001, 0.2)])
def test_what_moves_or_has_just_come_to_rest_does_not_sleep(speed_m_s: float, seconds: float) -> None:
    assert not watched(speed_m_s, seconds=seconds).lasts(HERE, HERE)


@pytest.mark.parametrize("name", ["cloth_hang", "pour_water"])
def test_a_world_that_sleeps_goes_on_in_time_and_stays_as_it_is_until_its_tool_moves(name: str) -> None:
    task = load(name)
    world = kind_of(task.stage).build(task.stage, task.start(0), 0.0)
    tool = world.tool.copy()
    for _ in range(60):
        before = world.nodes()
        world.step(tool, 0.05)
        if np.array_equal(before, world.nodes()):
            break
    else:
        pytest.fail("It did not come to rest in 3 s.")
    slept_s = world.time_s
    world.step(tool, 100.0)
    np.testing.assert_array_equal(before, world.nodes())
    assert world.time_s == pytest.approx(slept_s + 100.0, abs=0.01)
    tool[1] += 0.02
    world.step(tool, 0.2)
    assert not np.array_equal(before, world.nodes())
