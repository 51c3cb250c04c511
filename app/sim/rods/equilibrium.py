"""Friction that holds a rope as it is seen: the table's bristles that balance its elastic forces."""

import jax
import jax.numpy as jnp
from jaxtyping import Float

from app.sim.rods.effect import RodProperties
from app.sim.rods.scene import RodScene

_BRISTLES, _BENDS = slice(4, 6), 7
"""Rows of `RodState.nodes`."""


def balance_bristles(
    scene: RodScene, nodes: Float[jax.Array, "B 8 n"], properties: RodProperties, bristle_n_m: float
) -> Float[jax.Array, "B 8 n"]:
    """The same states, those of which no bristle is strained with bristles of the stiffness `bristle_n_m` [N/m].

    A rope that was seen at rest is in equilibrium: the table bears what springs back of its bends, at each node as far
    as Coulomb's bound mu m g. A rope that has been simulated has bristles of its own. Differentiable in all of it.
    """
    force = _elastic_forces(scene, nodes, properties)
    bound = (scene.gravity_m_s2 * properties.table_friction[:, None] * properties.mass)[:, None]
    size = jnp.sqrt(jnp.square(force).sum(1, keepdims=True) + 1e-20)
    bristles = nodes[:, _BRISTLES]
    seen = (bristles == 0).all((1, 2), keepdims=True)
    balance = force * (bound / jnp.maximum(size, bound)) / bristle_n_m
    return nodes.at[:, _BRISTLES].add(jnp.where(seen, balance, 0.0))


def _elastic_forces(
    scene: RodScene, nodes: Float[jax.Array, "B 8 n"], properties: RodProperties
) -> Float[jax.Array, "B 2 n"]:
    """Forces [N] on nodes whose yield is centred on their bends, as `find_elastic_forces` in rod.h has them."""
    moment = (1 - properties.permanent_set)[:, None] * properties.rigidity / scene.rest_m * nodes[:, _BENDS]
    edges = jnp.diff(nodes[:, :2], axis=2)
    square = jnp.square(edges).sum(1)
    shear = jnp.diff(moment, axis=1) / square
    ahead = jnp.stack([-edges[:, 1] * shear, edges[:, 0] * shear], axis=1)
    return jnp.pad(ahead, ((0, 0), (0, 0), (1, 0))) - jnp.pad(ahead, ((0, 0), (0, 0), (0, 1)))
