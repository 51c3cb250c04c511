"""Conformance of tasks: each file in `app/tasks` that defines one is tested by its presence."""

import re
from functools import cache
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from app.config import Site
from app.core.geometry.chamfer import chamfer_m2
from app.jobs import jit_cache
from app.jobs.worker_api import nominal_model
from app.perception.reconstruct import reconstruct
from app.planner.search.tree import first_action
from app.policy.base import PARKED_POSE, PlanningState
from app.rig.simulated.lockstep import LockStep
from app.sim.model.params import PARAMETERS
from app.sim.tools.base import COORDINATES
from app.tasks import Task, load, names
from bench.approval import approved
from tests.programs import program

TASKS = names()
SPLITS = sorted([*TASKS, *(f"{name}-hard" for name in TASKS if load(name).hard)])
"""Tasks with their easy problems and with their hard ones, whose fixtures and actions may be others."""
DOCS = Path(__file__).parents[2] / "docs"
SEEN_M = 0.008
"""Largest root of half the Chamfer distance between seen and true object [m]."""
MOVED_M = 0.003
"""The same of the object as it is laid and as it then lies."""
SEED = 3


@cache
def opened(name: str) -> tuple[Task, LockStep]:
    """The task and its cell before anything was done; tests only look."""
    task = load(name)
    return task, LockStep(task.stage, task.start(SEED), Site(), SEED)


def truth(name: str, count: int) -> np.ndarray:
    task, cell = opened(name)
    return task.particles(cell.nodes(), count)


def coordinates(task: Task) -> int:
    return sum(COORDINATES[tool.motion] for tool in task.scene.tools)


@pytest.mark.parametrize("name", TASKS)
def test_a_task_is_named_as_its_file_with_presets_for_cpu_and_gpu_and_a_page_with_a_picture(name: str) -> None:
    task = load(name)
    assert task.name == name
    assert set(task.presets) == {"cpu", "gpu"}
    assert task.preset("gpu").branches >= task.preset("cpu").branches >= 4
    assert task.horizon >= 1
    page = (DOCS / "tasks" / f"{name}.md").read_text()
    pictures = re.findall(r"\]\(\.\./images/([^)]+)\)", page)
    assert pictures
    assert all((DOCS / "images" / picture).is_file() for picture in pictures)
    assert f"tasks/{name}.md" in (DOCS.parent / "mkdocs.yml").read_text()


@pytest.mark.parametrize("name", TASKS)
def test_the_nominal_model_is_version_0_and_inside_every_range(name: str) -> None:
    model, known = nominal_model(name), [spec.name for spec in PARAMETERS]
    assert model.version == 0
    assert [parameter.name for parameter in model.parameters] == known
    assert set(load(name).calibrated) <= set(known)
    assert load(name).calibrated
    for parameter, spec in zip(model.parameters, PARAMETERS, strict=True):
        assert spec.low <= parameter.value <= spec.high


@pytest.mark.parametrize("name", SPLITS)
def test_a_problem_is_its_seeds_and_no_problem_is_solved_before_it_begins(name: str) -> None:
    task = load(name)
    count = task.preset("cpu").particle_count
    low, high = np.array(Site().limits.workspace.low), np.array(Site().limits.workspace.high)
    starts = list[np.ndarray]()
    for seed in range(5):
        start, goal = task.start(seed), task.goal(seed, count)
        starts.append(start)
        np.testing.assert_array_equal(start, task.start(seed))
        np.testing.assert_array_equal(goal, task.goal(seed, count))
        x = task.particles(start, count)
        assert x.shape == goal.shape == (count, 3)
        for points in (x, goal):
            assert np.isfinite(points).all()
            assert (points[:, :2] >= low[:2]).all()
            assert (points <= high).all()
            assert (points[:, 2] >= 0).all()
        assert task.success.is_reached(goal, goal)
        assert task.success.share(goal, goal) >= 0.9
        assert not task.success.is_reached(x, goal)
        assert task.success.share(x, goal) < 0.9
    assert not np.array_equal(starts[0], starts[1])


@pytest.mark.parametrize("name", SPLITS)
def test_an_object_is_laid_at_rest(name: str) -> None:
    task, cell = opened(name)
    laid, lies = (nodes.astype(np.float32) for nodes in (task.start(SEED), cell.nodes()))
    assert np.sqrt(chamfer_m2(laid, lies) / 2) < MOVED_M


@pytest.mark.parametrize("name", SPLITS)
def test_random_actions_are_allowed_stay_in_the_site_and_end_where_they_say(name: str) -> None:
    task, cell = opened(name)
    actions, x, tool = task.actions, truth(name, 200), cell.tool
    drawn = actions.sample(np.random.default_rng(0), x, tool, 8)
    assert drawn.shape == (8, actions.size)
    assert actions.scale().shape == (actions.size,)
    now = PlanningState.at_rest(jnp.tile(jnp.asarray(x)[None], (8, 1, 1)), tool)
    project, allowed = program(actions.project), program(actions.is_allowed)
    projected = project(jnp.asarray(drawn), now)
    assert np.asarray(allowed(projected, now)).sum() >= 6
    np.testing.assert_allclose(project(projected, now), projected, atol=2e-3)
    path = np.asarray(program(actions.tool_path)(projected, now.tool))
    assert path.shape == (8, actions.substeps + 1, coordinates(task))
    assert np.isfinite(path).all()
    after = np.asarray(program(actions.after)(projected, now.tool))
    for index in np.flatnonzero(np.asarray(allowed(projected, now))):
        motion = actions.motion(np.asarray(projected)[index], tool, Site())
        assert Site().limits.workspace.contains(motion.positions)
        if motion.continues:
            np.testing.assert_allclose(after[index, :3], motion.poses[-1][:3], atol=1e-4)


@pytest.mark.serial
@pytest.mark.parametrize("name", TASKS)
def test_the_cameras_see_the_object_where_it_is(name: str) -> None:
    task, cell = opened(name)
    count = task.preset("cpu").particle_count
    seen = reconstruct(cell.look(), task.reconstruction("cpu"), cell.tool).positions
    assert seen.shape == (count, 3)
    assert np.sqrt(chamfer_m2(seen, truth(name, count)) / 2) < SEEN_M


@pytest.mark.parametrize("name", TASKS)
def test_the_experts_action_is_allowed_and_the_same_action_gives_the_same_world(name: str) -> None:
    task = load(name)
    count = task.preset("cpu").particle_count
    ends = list[np.ndarray]()
    for _ in range(2):
        cell = LockStep(task.stage, task.start(SEED), Site(), SEED)
        x, goal, tool = task.particles(cell.nodes(), count), task.goal(SEED, count), cell.tool
        now = PlanningState.at_rest(jnp.asarray(x)[None], tool)
        action = program(task.actions.project)(first_action(task.policy, task.policy.prepare(x, goal), now), now)
        assert bool(program(task.actions.is_allowed)(action, now)[0])
        executed = cell.execute(approved(task.actions.motion(np.asarray(action)[0], tool, Site()), x))
        assert executed.outcome == "completed"
        made = task.actions.measured_path(executed.tool)
        assert made.shape == (task.actions.substeps + 1, coordinates(task))
        ends.append(cell.nodes())
    np.testing.assert_array_equal(ends[0], ends[1])


@pytest.mark.parametrize("name", TASKS)
def test_the_simulator_lets_an_action_that_touches_nothing_change_little(name: str) -> None:
    """An object at rest stays where it is seen while the tool stays where it is."""
    task, cell = opened(name)
    count = task.preset("cpu").particle_count
    x = truth(name, count)
    standing = np.repeat(cell.tool[None], 50, axis=0)
    path = task.actions.measured_path(standing)
    phi = jnp.asarray(jit_cache.phi_of(nominal_model(name)))[None]
    after = np.asarray(jit_cache.advance(name, count)(phi, jnp.asarray(x)[None], jnp.asarray(path)[None]))[0]
    assert np.isfinite(after).all()
    assert np.sqrt(chamfer_m2(after, x) / 2) < SEEN_M


@pytest.mark.parametrize("name", SPLITS)
def test_where_a_tool_is_away_actions_that_begin_anywhere_may_be_made(name: str) -> None:
    task, site = load(name), Site()
    x = task.goal(0, 100)
    drawn = task.actions.sample(np.random.default_rng(0), x, PARKED_POSE, 8)
    now = PlanningState.at_rest(jnp.tile(jnp.asarray(x)[None], (8, 1, 1)), PARKED_POSE)
    for action in np.asarray(program(task.actions.project)(jnp.asarray(drawn), now)):
        assert site.limits.workspace.contains(task.actions.motion(action, PARKED_POSE, site).positions)
