"""The paper's decisions at the paper's sizes, timed whole: sample or start, roll out, ten steps of gradient descent.

With the nominal model: a planner compiles the effects that its model needs, and that needs none.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, final

import jax
import jax.numpy as jnp
import numpy as np

from app.calibration.evidence import Evidence, ModelScorer
from app.core.geometry.chamfer import chamfer_m2
from app.jobs import jit_cache
from app.planner.actions.actions import Pushes
from app.planner.search.plan import TreePlanner
from app.planner.search.request import PlanRequest
from app.planner.search.tree import TreeConfig
from app.policy.base import PARKED_POSE, PlanningState
from app.sim.materials.cloth import ClothMaterial
from app.sim.materials.granular import Granular
from app.sim.model.params import NOMINAL_PHYSICS, nominal_phi
from app.sim.model.scene import Body, Scene
from app.sim.runtime.rollout import Simulate, make_rollout
from app.sim.state import State
from app.sim.tools.box import BoxCollider, GripperCollider
from app.tasks import load

GRADIENT_STEPS = 10
SUBSTEPS = 20
"""Substeps of one displacement (paper, rope pushing: 20 displacements an action)."""


@final
@dataclass(frozen=True, kw_only=True)
class Decision:
    """`candidates` of `particles` for `substeps`, and the median of the seconds that it took after a first one."""

    case: str
    particles: int
    candidates: int
    substeps: int
    seconds: float


def decisions(repeats: int = 3) -> list[Decision]:
    """All of them, in the order of the paper's table."""
    return [rope(repeats), beans(repeats), cloth(repeats), calibration(repeats)]


def rope(repeats: int) -> Decision:
    """16 branches, depth 3, 2000 particles, 20 displacements of 20 substeps."""
    task = load("rope_push")
    size = task.preset("gpu")
    assert isinstance(task.actions, Pushes)
    space = replace(task.actions, push_substeps=20 * SUBSTEPS, rest_substeps=0)
    planner = TreePlanner(
        search=TreeConfig(
            space=space,
            policy=task.policy,
            weights=task.weights,
            advance=jit_cache.action_simulator("rope_push", size.particle_count),
            branches=16,
            depth=3,
        ),
        descent=task.descent,
        gradient_steps=GRADIENT_STEPS,
    )
    x, goal = (task.goal(seed, size.particle_count) for seed in (0, 1))
    phi = jit_cache.phi_of(jit_cache.nominal_model("rope_push"))
    seconds = timed(lambda seed: planner(PlanRequest(observed=x, goal=goal, phi=phi, seed=seed)), repeats)
    return Decision(
        case="rope decision",
        particles=size.particle_count,
        candidates=16,
        substeps=3 * 20 * SUBSTEPS,
        seconds=seconds,
    )


def beans(repeats: int) -> Decision:
    """150 branches, depth 1, 300 beans swept along a straight line."""
    count, branches, substeps = 300, 150, 20 * SUBSTEPS
    scene = Scene(
        bodies=(Body(volume_m3=count * 5e-7, density_kg_m3=800.0, material=Granular()),),
        tools=(BoxCollider(half_m=(0.04, 0.006, 0.03), motion="slides"),),
        low=(-0.25, -0.25, -0.025),
        high=(0.25, 0.25, 0.10),
        dt_s=5e-4,
    )
    rng = np.random.default_rng(0)
    x = rng.uniform((-0.08, -0.08, 0.004), (0.08, 0.08, 0.012), (count, 3)).astype(np.float32)
    goal = x * np.array([0.3, 0.3, 1.0], np.float32)

    def path(actions: jax.Array) -> jax.Array:
        share = jnp.linspace(0.0, 1.0, substeps + 1)[None, :, None]
        along = actions[:, None, :2] * (1 - share) + actions[:, None, 2:] * share
        return jnp.concatenate([along, jnp.full((*along.shape[:2], 1), 0.03)], axis=-1)

    start = rng.uniform(-0.12, 0.12, (branches, 4)).astype(np.float32)
    simulate = make_rollout(scene, particle_count=count, effects=())
    seconds = timed(partial(_descended, simulate, path, x, goal, start, 1), repeats)
    return Decision(case="bean decision", particles=count, candidates=branches, substeps=substeps, seconds=seconds)


def cloth(repeats: int) -> Decision:
    """16 branches, depth 3, 1000 particles, 8 small actions of x, y, z and gripper of 20 substeps each."""
    side, branches, depth, moves = 32, 16, 3, 8
    scene = Scene(
        bodies=(Body(volume_m3=0.3 * 0.3 * 0.002, density_kg_m3=100.0, material=ClothMaterial()),),
        tools=(GripperCollider(),),
        low=(-0.30, -0.30, -0.025),
        high=(0.30, 0.30, 0.30),
        dt_s=2e-4,
    )
    axis = np.repeat(np.linspace(-0.145, 0.145, side)[:, None], side, axis=1)
    x = np.stack([axis, axis.T, np.full((side, side), 0.005)], axis=-1).reshape(-1, 3)[:1000].astype(np.float32)
    goal = x * np.array([0.5, 1.0, 1.0], np.float32)

    def path(actions: jax.Array) -> jax.Array:
        corners = jnp.cumsum(actions.reshape(-1, moves, 4), axis=1) + jnp.array([-0.14, -0.14, 0.01, 0.03])
        whole = jnp.repeat(corners, SUBSTEPS, axis=1)
        poses = jnp.concatenate([whole[:, :1], whole], axis=1)
        turn = jnp.broadcast_to(jnp.array([1.0, 0.0, 0.0, 0.0]), (*poses.shape[:2], 4))
        return jnp.concatenate([poses[..., :3], turn, jnp.maximum(poses[..., 3:], 0.0)], axis=-1)

    rng = np.random.default_rng(0)
    start = (0.002 * rng.standard_normal((branches, depth * moves * 4))).astype(np.float32)
    simulate = make_rollout(scene, particle_count=len(x), effects=())
    seconds = timed(partial(_descended, simulate, path, x, goal, start, depth), repeats)
    return Decision(
        case="cloth decision",
        particles=len(x),
        candidates=branches,
        substeps=depth * moves * SUBSTEPS,
        seconds=seconds,
    )


def calibration(repeats: int) -> Decision:
    """One update from 10 demonstrations of 20 transitions: all losses and all their gradients."""
    task = load("rope_push")
    particles, transitions = 2000, 200
    x, after = (task.goal(seed, particles) for seed in (0, 1))
    rng = np.random.default_rng(0)
    actions = task.actions.sample(rng, x, PARKED_POSE, transitions)
    away = PlanningState.at_rest(jnp.tile(x, (transitions, 1, 1))).tool
    evidence = Evidence(
        before=np.tile(x, (transitions, 1, 1)),
        tool=np.asarray(task.actions.tool_path(jnp.asarray(actions), away)),
        after=np.tile(after, (transitions, 1, 1)),
    )
    predictor = ModelScorer(advance=jit_cache.advance("rope_push", particles), chunk=50)
    phi = jit_cache.phi_of(jit_cache.nominal_model("rope_push"))
    seconds = timed(lambda _seed: predictor.slopes(phi, evidence), repeats)
    return Decision(
        case="calibration update",
        particles=particles,
        candidates=transitions,
        substeps=task.actions.substeps,
        seconds=seconds,
    )


def timed(decide: Callable[[int], Any], repeats: int) -> float:
    """Median seconds of several calls after a first one, which compiles."""
    decide(0)
    seconds: list[float] = []
    for repeat in range(repeats):
        begin = time.perf_counter()
        jax.block_until_ready(decide(repeat + 1))
        seconds.append(time.perf_counter() - begin)
    return float(np.median(seconds))


def _descended(
    simulate: Simulate,
    path: Callable[[jax.Array], jax.Array],
    x: np.ndarray,
    goal: np.ndarray,
    actions: np.ndarray,
    depth: int,
    _seed: int,
) -> jax.Array:
    return _descend(simulate, path, depth, jnp.asarray(x), jnp.asarray(goal), jnp.asarray(actions))


@partial(jax.jit, static_argnums=(0, 1, 2))
def _descend(
    simulate: Simulate,
    path: Callable[[jax.Array], jax.Array],
    depth: int,
    x: jax.Array,
    goal: jax.Array,
    actions: jax.Array,
) -> jax.Array:
    """Ten steps of gradient descent on the final Chamfer distance of every branch, and a last look at the result."""
    phi = jnp.tile(nominal_phi()[: len(NOMINAL_PHYSICS)], (len(actions), 1))

    def losses(actions: jax.Array) -> jax.Array:
        state = State.at_rest(jnp.repeat(x[None], len(actions), axis=0))
        for part in jnp.split(actions, depth, axis=1):
            state = State.at_rest(simulate(phi, state, path(part)).x)
        return jax.vmap(chamfer_m2, in_axes=(0, None))(state.x, goal)

    def total(actions: jax.Array) -> jax.Array:
        return losses(actions).sum()

    def step(actions: jax.Array, _: None) -> tuple[jax.Array, None]:
        slopes = jnp.nan_to_num(jax.grad(total)(actions))
        norms = jnp.linalg.norm(slopes, axis=1, keepdims=True)
        return actions - 2e-3 * slopes / jnp.maximum(norms, 1e-12), None

    return losses(jax.lax.scan(step, actions, None, length=GRADIENT_STEPS)[0])
