"""A rope task whose object is simulated as a rod."""

from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest

from app.core.errors import UsageError
from app.jobs import jit_cache
from app.jobs.worker_api import doubt, nominal_model, plan
from app.planner.search.plan import Plan
from app.planner.search.request import PlanRequest
from app.sim.model.params import acting, index
from app.tasks import load
from tests.planner.table import PHI, planner, rope

RODS = "rope_push@rods"
COUNT = 300


def test_it_is_the_same_task_with_another_simulation():
    rods, points = load(RODS), load("rope_push")
    assert (rods.name, rods.dynamics, points.dynamics) == (RODS, "rods", "mpm")
    assert rods.stage == points.stage
    assert np.array_equal(rods.goal(3, COUNT), points.goal(3, COUNT))
    assert rods.actions.reach == points.actions.reach
    assert nominal_model(RODS).task == RODS


@pytest.mark.parametrize(("name", "said"), [("rope_push@threads", "rods"), ("bean_sweep@rods", "mpm")])
def test_other_dynamics_are_refused_with_those_that_there_are(name: str, said: str):
    with pytest.raises(UsageError, match=said):
        load(name)


def test_a_model_that_needs_other_effects_is_refused_by_their_names():
    phi = jit_cache.phi_of(nominal_model(RODS)).copy()
    phi[index("cohesion")] = 5.0
    with pytest.raises(UsageError, match="cohesion"):
        jit_cache.planner(RODS, "cpu", phi)


def test_a_model_moves_the_rope_with_the_effects_that_it_needs():
    task, phi = load(RODS), jit_cache.phi_of(nominal_model(RODS)).copy()
    phi[index("tilt_x")] = 5.0
    phi[index("table_friction")] = 0.02
    start = jnp.asarray(task.problems.particles(task.start(0), COUNT))[None]
    assert task.rods is not None
    away = jnp.tile(jnp.array([0.2, -0.3, 0.3]), (1, 1 + round(0.3 / task.rods.scene.dt_s), 1))
    end = jit_cache.advance(RODS, COUNT, acting(phi))(jnp.asarray(phi)[None], start, away)
    pull = 9.81 * (np.radians(5.0) - 0.02)
    assert (end - start).mean((0, 1))[1] == pytest.approx(-pull * 0.3**2 / 2, rel=0.05)


@cache
def planned() -> Plan:
    task = load(RODS)
    start = task.problems.particles(task.start(0), COUNT)
    return plan(RODS, "cpu", start, task.goal(0, COUNT), nominal_model(RODS), 0)


def test_a_plan_brings_the_rope_nearer_to_its_goal_by_the_model():
    assert planned().predicted_chamfer_m2 < 0.6 * planned().chamfer_m2


def test_a_plan_says_where_the_nodes_will_be_and_the_next_one_begins_there():
    task, found = load(RODS), planned()
    scene = task.rods.scene if task.rods else None
    assert scene is not None
    assert found.centreline.shape == (2, scene.nodes)
    lengths = np.linalg.norm(np.diff(found.centreline, axis=1), axis=0)
    np.testing.assert_allclose(lengths, scene.rest_m, rtol=0.02)
    beside = np.linalg.norm(found.predicted[:, None, :2] - found.centreline.T, axis=-1).min(1)
    assert beside.max() < 1.5 * scene.radius_m
    # Seen there, in whatever order, the rope begins at the node that it began with, which no cloud tells.
    seen, backwards = found.predicted[np.random.default_rng(0).permutation(COUNT)], found.centreline[:, ::-1]
    for near in (found.centreline, np.ascontiguousarray(backwards)):
        again = plan(RODS, "cpu", seen, task.goal(0, COUNT), nominal_model(RODS), 0, near=near)
        there = task.initial_state(jnp.asarray(seen)[None], jnp.asarray(near)).centreline[0]
        assert np.linalg.norm(there - near, axis=0).mean() < scene.radius_m / 4
        assert again.centreline.shape == near.shape
        follows = np.linalg.norm(again.centreline - near, axis=0).sum()
        assert follows < np.linalg.norm(again.centreline[:, ::-1] - near, axis=0).sum()


def test_what_is_no_rope_has_no_centreline():
    assert planner()(PlanRequest(observed=rope(), goal=rope(0.05), phi=PHI)).centreline.shape == (2, 0)


def test_what_no_planar_rod_can_be_is_said_and_an_open_rope_is_not_doubted():
    task = load(RODS)
    x = task.problems.particles(task.start(0), COUNT)
    assert doubt(RODS, x) == ""
    up, aside = np.float32([[0, 0, 0.05], [0, 0.3, 0]])
    at_an_end = np.linalg.norm(x - task.start(0)[0], axis=1, keepdims=True) < 0.08
    assert "lifted" in doubt(RODS, np.where(at_an_end, x + up, x))
    assert "no one rope" in doubt(RODS, np.concatenate([x, x + aside]))
    assert doubt("rope_push", x + up) == ""


def test_pushes_that_touch_nothing_move_nothing():
    task = load(RODS)
    start = jnp.asarray(task.problems.particles(task.start(0), COUNT))[None]
    away = jnp.tile(jnp.array([0.2, -0.3, 0.3]), (1, task.actions.substeps + 1, 1))
    phi = jnp.asarray(jit_cache.phi_of(nominal_model(RODS)))[None]
    end = jit_cache.advance(RODS, COUNT)(phi, start, away)
    assert np.abs(end - start).max() < 1e-4
