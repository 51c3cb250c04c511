"""Write a planner, which betters the branches of the tree by an evolution strategy, and have it decide on one push.

Start it with `python examples/07_planner.py`; in `app/planner/methods/evolution.py` it would be `--planner evolution`.
"""

import jax
import jax.numpy as jnp
import numpy as np
import tyro
from jaxtyping import Array, Float, Float32, PRNGKeyArray

from app.config import Site
from app.planner.base import Planner
from app.planner.optimise import Descended, Descent, Evaluate
from app.planner.plan import Plan, TreePlanner
from app.planner.tree import Rollout, Search
from app.tasks import compiled, load, nominal_model
from app.ui.words import millimetres

GENERATIONS, STEP = 8, 0.5


def evolve(evaluate: Evaluate, actions: Float[Array, "B D A"], scale: Float32[np.ndarray, " A"]) -> Descended:
    """Each branch mutates and keeps what is cheaper: a (1 + 1) strategy (Rechenberg 1973, "Evolutionsstrategie")."""

    def generation(best: Rollout, key: PRNGKeyArray) -> tuple[Rollout, Float[Array, " B"]]:
        trial = evaluate(best.actions + STEP * scale * jax.random.normal(key, actions.shape))
        better = trial.judged < best.judged

        def chosen(new: Array, old: Array) -> Array:
            return jnp.where(better.reshape(-1, *[1] * (new.ndim - 1)), new, old)

        best = jax.tree.map(chosen, trial, best)
        return best, best.cost

    first = evaluate(actions)
    best, costs = jax.lax.scan(generation, first, jax.random.split(jax.random.key(0), GENERATIONS))
    return Descended.sampled(best, jnp.concatenate([first.cost[None], costs]))


def planner(search: Search, descent: Descent, gradient_steps: int) -> Planner:
    """The tree without gradients, as `made` asks a file of `app/planner/methods` for it."""
    return TreePlanner(search=search, descent=descent, gradient_steps=gradient_steps, optimise=evolve)


def main(task: str = "rope_push@rods", preset: str = "cpu", seed: int = 0) -> Plan:
    """Plan the first push of a problem with the nominal model."""
    data, phi = load(task), compiled.phi_of(nominal_model(task))
    count = data.preset(preset).particle_count
    decide = planner(compiled.search(task, preset, phi), data.descent, gradient_steps=0)
    plan = decide(data.particles(data.start(seed), count), data.goal(seed, count), phi, seed=seed, site=Site())
    before, after, best = millimetres(plan.chamfer_m2), millimetres(plan.predicted_chamfer_m2), plan.branches[plan.best]
    print(f"{before:.1f} -> {after:.1f} mm from the goal; cost {best.cost_before:.5f} -> {best.cost_after:.5f}")
    return plan


if __name__ == "__main__":
    tyro.cli(main)
