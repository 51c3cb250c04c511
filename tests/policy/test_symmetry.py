"""Symmetry: actions moved on the table move the simulator's tool along the moved path, and scripted experts agree."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from app.planner.search.tree import first_action
from app.policy.base import PlanningState
from app.policy.symmetry import Isometry, Symmetry
from app.tasks import load, names
from tests.programs import program

COUNT = 12


def drawn(seed: int, symmetry: Symmetry) -> Isometry:
    return symmetry.draw(np.random.default_rng(seed), COUNT)


QUARTERS = (0.0, np.pi / 2, np.pi, -np.pi / 2)
ANY = Symmetry(about_m=(0.5, 0.1), turns=True, mirrored=True, shift_m=(0.1, 0.05))


def test_distances_and_heights_stay() -> None:
    rng = np.random.default_rng(0)
    x, by = jnp.asarray(rng.normal(size=(COUNT, 7, 3)), jnp.float32), drawn(1, ANY)
    moved = by.places(x)
    before, after = (np.linalg.norm(each[:, :, None] - each[:, None], axis=-1) for each in (x, moved))
    np.testing.assert_allclose(after, before, atol=1e-5)
    np.testing.assert_array_equal(moved[..., 2], x[..., 2])
    np.testing.assert_allclose(np.linalg.det(np.asarray(by.matrix)), by.side, atol=1e-6)


def test_what_it_turns_about_stays_there_but_for_the_shift() -> None:
    by = drawn(2, ANY)
    about = np.tile(np.array(ANY.about_m, np.float32), (COUNT, 1))
    off = np.abs(np.asarray(by.places(jnp.asarray(about))) - about)
    assert (off <= np.array(ANY.shift_m) + 1e-6).all()


def test_without_any_symmetry_nothing_moves() -> None:
    by, none = drawn(3, Symmetry()), Isometry.identity(COUNT)
    for found, wanted in zip(by, none, strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-9)


@pytest.mark.parametrize("name", names())
def test_a_moved_action_moves_the_tool_along_the_moved_way(name: str) -> None:
    task, rng = load(name), np.random.default_rng(4)
    symmetry = task.symmetry if task.actions.size != 42 else ANY
    by, x = drawn(5, symmetry), task.goal(0, task.preset("cpu").particle_count)
    tool = jnp.tile(jnp.asarray(np.array([0.45, 0.02, 0.25, 0.0, 0.8, 0.0, 0.6, 0.05]), jnp.float32), (COUNT, 1))
    actions = jnp.asarray(task.actions.sample(rng, x, np.asarray(tool[0], np.float64), COUNT))
    tool_path = program(task.actions.tool_path)
    way = tool_path(actions, tool)
    moved = tool_path(program(task.actions.transform)(actions, by), by.poses(tool))
    np.testing.assert_allclose(moved[..., :3], by.places(way[..., :3]), atol=2e-5)
    if way.shape[-1] == 7:
        wanted = np.stack([by.poses(jnp.pad(way[:, at], ((0, 0), (0, 1))))[:, 3:7] for at in (0, -1)], axis=1)
        found = np.asarray(moved)[:, [0, -1], 3:]
        turn_only = name.startswith("pour")
        same = np.abs((found * wanted).sum(-1))
        assert not turn_only or same == pytest.approx(np.ones_like(same), abs=1e-4)


@pytest.mark.parametrize("name", names())
def test_the_scripted_expert_does_alike_what_is_moved_by_a_symmetry_of_its_task(name: str) -> None:
    task = load(name).demonstration_task
    count = task.preset("cpu").particle_count
    x = task.particles(task.start(3), count)
    goal = task.goal(3, count)
    tool = jnp.tile(jnp.asarray(np.array([0.40, -0.02, 0.25, 0.0, 1.0, 0.0, 0.0, 0.08]), jnp.float32), (COUNT, 1))
    # Some experts try directions a quarter turn, and parts of that, apart.
    quarters = replace(task.symmetry, turns=False, angles_rad=QUARTERS) if task.symmetry.turns else task.symmetry
    by = drawn(6, quarters)
    here = PlanningState.at_rest(jnp.tile(jnp.asarray(x)[None], (COUNT, 1, 1)))._replace(tool=tool)
    wanted = program(task.actions.transform)(first_action(task.policy, task.policy.prepare(x, goal), here), by)
    found = [_acted(task, np.asarray(by.places(here.x))[one], goal, by, one, tool) for one in range(COUNT)]
    same = np.linalg.norm(np.concatenate(found) - np.asarray(wanted), axis=1)
    # A choice between two ways that are as good falls either way.
    assert (same < 1e-3).mean() >= 0.7


def _acted(task, x: np.ndarray, goal: np.ndarray, by: Isometry, one: int, tool) -> np.ndarray:
    here = Isometry(*(each[one : one + 1] for each in by))
    moved = np.asarray(here.places(jnp.asarray(goal)[None]))[0]
    now = PlanningState.at_rest(jnp.asarray(x)[None])._replace(tool=here.poses(tool[one : one + 1]))
    return np.asarray(first_action(task.policy, task.policy.prepare(x, moved), now))
