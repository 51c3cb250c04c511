"""Failed simulations leave dumps behind, a few per process."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.config import Site
from app.core.errors import PlanningError, SimulationError
from app.core.messages import Executed, Transition, fresh_id
from app.core.motion import pointing_down
from app.jobs import failures, jit_cache
from app.jobs.worker_api import calibrate, nominal_model, plan
from app.planner.search.request import PlanRequest
from app.planner.search.tree import TreeConfig
from app.sim.diagnosis.dump import load_dump
from app.sim.diagnosis.failure_diagnosis import dissect
from app.sim.diagnosis.rod_failure_diagnosis import RodCase, dissect_rod
from app.sim.model.params import index
from app.sim.state import State
from app.tasks import load
from tests.planner.table import PHI, SPACE, rope, search

BAD = 2


@pytest.fixture(autouse=True)
def fresh_process() -> Iterator[None]:
    failures._room.cache_clear()
    yield
    failures._room.cache_clear()


def still(phi: jax.Array, state: State, tool: jax.Array) -> State:
    """Simulator in which nothing moves."""
    return state


def breaking(phi: jax.Array, state: State, tool: jax.Array) -> State:
    """Simulator in which nothing moves, and one branch becomes NaN."""
    return state._replace(x=state.x.at[BAD].set(jnp.nan))


def of_plan(tree: TreeConfig, folder: Path, seed: int = 0) -> str:
    asked = PlanRequest(observed=rope(), goal=rope(0.05), phi=PHI, seed=seed, site=Site(recordings=folder))
    return failures.of_plan("rope_push", tree, asked)


def seen_after(before: np.ndarray, poses: np.ndarray, after: np.ndarray) -> Transition:
    """A transition seen before and after a motion along poses (M, 7)."""
    executed = Executed(
        id=fresh_id("executed"),
        time_s=0.0,
        approved_id=fresh_id("approved"),
        outcome="completed",
        reason="",
        times_s=np.arange(float(len(poses))),
        commanded=poses,
        measured=poses,
    )
    return Transition(id=fresh_id("transition"), time_s=0.0, before=before, executed=executed, after=after)


def test_the_first_branch_that_broke_is_dumped_with_the_action_it_broke_in(tmp_path: Path) -> None:
    said = of_plan(replace(search(), advance=breaking), tmp_path)
    (path,) = (tmp_path / failures.FOLDER).iterdir()
    assert said == f" `dipac replay {path}` shows what broke."
    dump = load_dump(path)
    assert dump.about == f"rope_push, seed 0, branch {BAD}, action 0"
    assert dump.case.setup.scene == load("rope_push").scene
    np.testing.assert_array_equal(dump.case.state.x[0], rope())
    np.testing.assert_array_equal(dump.case.phi[0], PHI)
    assert dump.case.substeps == SPACE.substeps


def test_where_all_branches_are_finite_nothing_is_left(tmp_path: Path) -> None:
    assert of_plan(replace(search(), advance=still), tmp_path) == ""
    assert not list(tmp_path.iterdir())


def test_a_process_leaves_a_few_dumps_and_no_more(tmp_path: Path) -> None:
    tree = replace(search(), advance=breaking)
    said = [of_plan(tree, tmp_path, seed) for seed in range(failures.DUMPS + 1)]
    assert len(list((tmp_path / failures.FOLDER).iterdir())) == failures.DUMPS
    assert said[-1] == f" This process has left {failures.DUMPS} dumps already, and leaves no more."


def test_a_folder_that_cannot_be_written_is_said_beside_the_failure(tmp_path: Path) -> None:
    (tmp_path / "taken").touch()
    assert "Cannot write the dump" in of_plan(replace(search(), advance=breaking), tmp_path / "taken")


def test_a_transition_of_a_rope_whose_tool_begins_in_it_is_dumped_as_a_rod(tmp_path: Path) -> None:
    """A finger that comes down inside of the rope: the calibration of table and cameras does not agree."""
    name = "rope_push@rods"
    x = load(name).goal(0, 300)
    through = x[len(x) // 2, :2] + 0.02 * np.linspace(0, 1, 30)[:, None]
    poses = np.concatenate([through, np.tile([0.006, 1.0, 0.0, 0.0, 0.0], (30, 1))], axis=1)
    phi = jit_cache.phi_of(nominal_model(name))
    phi[index("tilt_x")] = 1.0
    said = failures.of_transitions(name, [seen_after(x, poses, x)], phi, Site(recordings=tmp_path))
    (path,) = (tmp_path / failures.FOLDER).iterdir()
    assert said == f" `dipac replay {path}` shows what broke."
    dump = load_dump(path)
    assert isinstance(dump.case, RodCase)
    assert "one of 1 that are not predicted" in dump.about
    assert dump.case.setup.scene == load(name).rods.scene
    names = [spec.name for spec in dump.case.setup.specs()]
    assert dump.case.phi[0, names.index("tilt_x")] == 1.0
    np.testing.assert_allclose(dump.case.state.x[0], x, atol=1e-4)
    assert "inside the rope" in dissect_rod(dump.case).verdict()


@pytest.mark.slow
def test_a_transition_that_begins_off_the_grid_is_dumped(tmp_path: Path) -> None:
    x = load("rope_push").goal(0, 300)
    poses = np.tile(np.array([0.4, 0.0, 0.006, 1.0, 0.0, 0.0, 0.0]), (3, 1))
    seen = seen_after(x + np.float32([2.0, 0.0, 0.0]), poses, x)
    with pytest.raises(SimulationError, match=r"predicts none of the transitions; .* `dipac replay .*\.npz` shows"):
        calibrate("rope_push", "cpu", [seen], nominal_model("rope_push"), Site(recordings=tmp_path))
    (path,) = (tmp_path / failures.FOLDER).iterdir()
    assert f"transition {seen.id}, one of 1 that left their grid" in load_dump(path).about


@pytest.mark.slow
def test_a_plan_without_a_finite_branch_names_the_dump_it_left(tmp_path: Path) -> None:
    task = load("rope_push")
    x, goal = task.goal(1, 300), task.goal(0, 300)
    x[7] += np.float32([0.0, 0.0, 0.3])
    with pytest.raises(PlanningError, match=r"8 became non-finite.*`dipac replay .*\.npz` shows what broke"):
        plan("rope_push", "cpu", x, goal, nominal_model("rope_push"), 0, Site(recordings=tmp_path))
    (path,) = (tmp_path / failures.FOLDER).iterdir()
    assert "Particle 7 of candidate 0 is at" in dissect(load_dump(path).case).verdict()


@pytest.mark.slow
def test_a_drop_that_ran_off_the_grid_is_not_the_end_of_every_branch() -> None:
    task = load("pour_water")
    x, goal = task.particles(task.start(0), 300), task.goal(0, 300)
    tool = pointing_down(np.add(x.mean(0), (0.0, 0.0, 0.03)).astype(np.float64))
    x[7] = [0.6, 0.33, 0.004]
    found = plan("pour_water", "cpu", x, goal, nominal_model("pour_water"), 0, tool=tool)
    assert all(branch.finite for branch in found.branches)
