"""Write a planner, which betters random actions by an evolution strategy, and have it decide on one push of a rope.

Start it with `python examples/07_planner.py`; in `app/planner/methods/evolution.py` it would be `--planner evolution`.
"""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import tyro
from jaxtyping import Array, Float, Float32, PRNGKeyArray

from app.core.dialogue.words import millimetres
from app.jobs import jit_cache
from app.planner.search.budget import at_least, tree_rollouts
from app.planner.search.optimise import Evaluate, OptimizedRollouts, OptimizerConfig, select
from app.planner.search.plan import Plan, TreePlanner
from app.planner.search.request import PlanRequest
from app.planner.search.tree import Rollout, TreeConfig
from app.tasks import load


def evolve(
    evaluate: Evaluate, actions: Float[Array, "B D A"], scale: Float32[np.ndarray, " A"], *, steps: int, step: float
) -> OptimizedRollouts:
    """Each branch mutates and keeps what is cheaper: a (1 + 1) strategy (Rechenberg 1973, "Evolutionsstrategie")."""

    def generation(best: Rollout, key: PRNGKeyArray) -> tuple[Rollout, Float[Array, " B"]]:
        trial = evaluate(best.actions + step * scale * jax.random.normal(key, actions.shape))
        best = select(trial.masked_cost < best.masked_cost, trial, best)
        return best, best.cost

    first = evaluate(actions)
    best, costs = jax.lax.scan(generation, first, jax.random.split(jax.random.key(0), steps))
    return OptimizedRollouts.from_samples(best, jnp.concatenate([first.cost[None], costs]))


def planner(search: TreeConfig, descent: OptimizerConfig, gradient_steps: int) -> TreePlanner:
    """Without policy and gradients, and with as many rollouts as the tree has, the first ones included."""
    steps = at_least(tree_rollouts(search, gradient_steps) - search.branches, search.branches)
    optimise = partial(evolve, steps=steps, step=0.5)
    return TreePlanner(search=replace(search, guided=False), descent=descent, gradient_steps=0, optimise=optimise)


def main(name: str = "rope_push@rods", preset: str = "cpu", seed: int = 0) -> Plan:
    """Plan the first push of a problem with the nominal model."""
    task, size, phi = load(name), load(name).preset(preset), jit_cache.phi_of(jit_cache.nominal_model(name))
    decide = planner(jit_cache.search(name, preset, phi), task.descent, size.gradient_steps)
    x, goal = task.particles(task.start(seed), size.particle_count), task.goal(seed, size.particle_count)
    plan = decide(PlanRequest(observed=x, goal=goal, phi=phi, seed=seed))
    before, after = millimetres(plan.chamfer_m2), millimetres(plan.predicted_chamfer_m2)
    print(f"{before:.1f} -> {after:.1f} mm from the goal, by the cheapest of {len(plan.branches)} branches")
    return plan


if __name__ == "__main__":
    tyro.cli(main)
