"""The policies that come with the program: small, of this version, and good for something."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.core.geometry.chamfer import chamfer_m2
from app.jobs.jit_cache import nominal_model
from app.jobs.teaching import SHIPPED, lessons, load_learned, shipped_policy_file, simulator
from app.policy.base import PlanningState
from app.policy.learned.base import LearnedPolicy
from app.policy.learned.file import load_policy
from app.tasks import load, names

LARGEST_BYTES = 3_000_000
PROBLEMS = 12


@pytest.mark.parametrize("name", names())
def test_each_task_has_one_that_says_how_it_was_made(name: str) -> None:
    assert shipped_policy_file(name).stat().st_size <= LARGEST_BYTES
    _, origin = load_policy(shipped_policy_file(name), task=name, how=lessons(load(name)))
    assert origin.command.startswith(f"dipac train {name} --policy {origin.kind} ")
    assert len(origin.demonstrations) == 10
    assert all(demonstration in origin.command for demonstration in origin.demonstrations)


@pytest.mark.parametrize("name", ["bean_sweep", "rope_push"])
def test_its_first_actions_bring_objects_nearer_to_their_goals(name: str) -> None:
    task, policy = load(name), load_learned(SHIPPED, load(name))
    count = task.preset("cpu").particle_count
    x = np.stack([task.particles(task.start(seed), count) for seed in range(PROBLEMS)])
    goals = np.stack([task.goal(seed, count) for seed in range(PROBLEMS)])
    now = PlanningState.at_rest(jnp.asarray(x))
    actions = task.actions.project(acted(policy, x, goals), now)
    world = simulator(task, nominal_model(name), count)
    phi = jnp.tile(jnp.array(world.phi), (PROBLEMS, 1))
    after = world.advance(phi, now.state, task.actions.tool_path(actions, now.tool)).x
    gained = np.asarray(chamfer_m2(x, goals) - chamfer_m2(np.asarray(after), goals))
    made = np.asarray(task.actions.is_allowed(actions, now))
    assert made.mean() >= 0.75
    assert (gained[made] > 0).mean() >= 0.75


def acted(policy: LearnedPolicy, x: np.ndarray, goals: np.ndarray) -> jax.Array:
    """Actions of the policy, one for each situation."""
    act, each = jax.jit(policy.act), zip(x, goals, strict=True)
    made = [act(policy.prepare(one, goal), PlanningState.at_rest(jnp.asarray(one)[None])).mean for one, goal in each]
    return jnp.concatenate(made)
