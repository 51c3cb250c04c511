"""The laws of the simulated liquids: what is held stays, what is carried comes along, what is tilted pours."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.core.errors import SimulationError
from app.core.motion import pointing_down
from app.core.types import ToolPose
from app.rig.simulated.kinds import kind_of
from app.rig.simulated.worlds.liquid_world import DT_S, LiquidWorld
from app.rig.simulated.worlds.world import Nodes
from app.tasks import Task, load

ARM_S = 0.01
both = pytest.mark.parametrize("name", ["pour_water", "pour_soup"])


@cache
def task(name: str) -> Task:
    return load(name)


def world(name: str) -> LiquidWorld:
    found = kind_of(task(name).stage).build(task(name).stage, task(name).start(0), 0.0)
    assert isinstance(found, LiquidWorld)
    return found


def outside(name: str, x: Nodes, place: np.ndarray) -> np.ndarray:
    """Distance [m] of particles beyond the inner wall of a bowl held at `place`."""
    return np.linalg.norm(x - place, axis=1) - task(name).stage.tool.radius_m


def in_target(name: str, x: Nodes) -> float:
    return task(name).success.share(x.astype(np.float32), x.astype(np.float32))


def tilted(pose: ToolPose, angle_rad: float) -> ToolPose:
    turn = Rotation.from_rotvec([0.0, angle_rad, 0.0]) * Rotation.from_quat(pose[3:7], scalar_first=True)
    return np.array([*pose[:3], *turn.as_quat(scalar_first=True), 0.0])


def over_the_target(name: str) -> ToolPose:
    """Pose of a bowl whose lip, once it is tilted forward by 100 degrees, is over the target's middle."""
    x, y, z = task(name).stage.fixtures[0].place_m
    return pointing_down(np.array([x - 0.02, y, z + 0.10]))


@both
def test_a_world_of_the_usual_drops_has_its_own_time_steps(name: str) -> None:
    assert world(name).period_s == pytest.approx(DT_S)


@pytest.mark.parametrize("drops", [600, 1000, 1500])
def test_fewer_drops_have_longer_steps_of_which_a_period_of_the_arm_is_a_whole_number(drops: int) -> None:
    water = replace(task("pour_water").stage.body, drops=drops)
    stage, problems = task("pour_water").stage, replace(task("pour_water").problems, liquid=water)
    steps = ARM_S / LiquidWorld(replace(stage, body=water), problems.start(0)).period_s
    assert steps == pytest.approx(round(steps))
    assert steps < ARM_S / DT_S


@pytest.mark.slow
@both
def test_what_is_held_at_rest_stays_where_it_is_and_keeps_its_volume(name: str) -> None:
    cell = world(name)
    cell.step(cell.tool, 0.5)
    laid = cell.nodes()
    cell.step(cell.tool, 0.5)
    assert outside(name, cell.nodes(), cell.tool[:3]).max() < 1e-3
    assert np.linalg.norm(cell.nodes() - laid, axis=1).mean() < 2e-3
    # Its middle would fall by a millimetre where a tenth of the volume were lost.
    assert cell.nodes()[:, 2].mean() == pytest.approx(task(name).start(0)[:, 2].mean(), abs=1e-3)


@pytest.mark.slow
@both
def test_what_is_carried_comes_along_and_what_is_tilted_pours_over_the_rim_and_through_no_wall(name: str) -> None:
    cell = world(name)
    there = over_the_target(name)
    cell.step(np.array([*cell.tool[:2], there[2], *cell.tool[3:]]), 0.4)
    cell.step(there, 0.8)
    cell.step(there, 0.4)
    assert outside(name, cell.nodes(), there[:3]).max() < 1e-3
    assert in_target(name, cell.nodes()) == 0.0
    for angle in np.linspace(0.2, 1.75, 9):
        cell.step(tilted(there, angle), 0.25)
    cell.step(cell.tool, 1.0)
    assert in_target(name, cell.nodes()) > 0.8
    assert cell.nodes()[:, 2].min() > -1e-3
    if name == "pour_water":
        # It stands as high as its volume; pieces that came to lie on each other keep a soup higher (docs/tasks).
        heights = [np.quantile(x[:, 2], 0.9) for x in (cell.nodes(), task(name).goal(0, 300))]
        assert heights[0] == pytest.approx(heights[1], abs=0.004)


@pytest.mark.slow
def test_the_same_calls_give_the_same_numbers() -> None:
    ends = []
    for _ in range(2):
        cell = world("pour_water")
        cell.step(cell.tool + np.array([0.02, 0, 0.01, 0, 0, 0, 0, 0]), 0.1)
        ends.append(cell.nodes())
    np.testing.assert_array_equal(*ends)


@pytest.mark.slow
def test_placing_the_bowl_takes_along_what_it_holds_and_no_time() -> None:
    cell = world("pour_water")
    before, x, time_s = cell.tool, cell.nodes(), cell.time_s
    cell.place(pointing_down(before[:3] + np.array([0.05, 0.02, -0.01])))
    np.testing.assert_allclose(cell.nodes() - x, np.tile([0.05, 0.02, -0.01], (len(x), 1)), atol=1e-6)
    assert cell.time_s == time_s


@both
def test_every_seed_begins_in_a_bowl_of_its_own_that_the_hand_holds(name: str) -> None:
    homes = [kind_of(task(name).stage).home(task(name).stage, task(name).start(seed)) for seed in range(3)]
    for seed, home in enumerate(homes):
        assert outside(name, task(name).start(seed), home[:3]).max() < 1e-3
        np.testing.assert_allclose(home[:3], task(name).problems.home_m, atol=0.045)
    assert min(np.linalg.norm(homes[0] - other) for other in homes[1:]) > 0.001


def test_a_liquid_that_is_nowhere_any_more_is_said_to_have_broken() -> None:
    broken = world("pour_water")
    away = pointing_down(np.array([np.nan, 0.0, 0.2]))
    with pytest.raises(SimulationError, match="not finite"):
        broken.step(away, 0.01)
