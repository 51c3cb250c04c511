"""The candidates divided among devices: those of this machine and, after `jax.distributed.initialize`, of all hosts."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from jaxtyping import Float

from app.sim.runtime.rollout import Simulate
from app.sim.state import Setting, State

AXIS = "candidates"


def mesh_of(devices: Sequence[Any] | None = None) -> Mesh:
    """A row of devices; None: all that JAX knows, on every host."""
    return Mesh(np.array(devices or jax.devices()), (AXIS,))


def sharding(mesh: Mesh) -> NamedSharding:
    """Sharding of arrays whose first axis is that of candidates. Placed with it, they need not move."""
    return NamedSharding(mesh, PartitionSpec(AXIS))


def over_devices(simulate: Simulate, mesh: Mesh) -> Simulate:
    """The same simulator, each device working on its share of the candidates; nothing is exchanged between them.

    The number of candidates need not be divisible: the last one is repeated until it is, and the copies cut off.
    """
    shares = mesh.devices.size
    spec = PartitionSpec(AXIS)
    divided = jax.shard_map(simulate, mesh=mesh, in_specs=spec, out_specs=spec, check_vma=False)

    def simulate_divided(
        phi: Float[jax.Array, "B P"],
        state: State,
        tool: Float[jax.Array, "B T A"],
        setting: Setting | None = None,
    ) -> State:
        candidates, particles = state.x.shape[:2]
        known = setting or Setting.unknown(candidates, particles)
        missing = -candidates % shares
        if missing == 0:
            return divided(phi, state, tool, known)

        def filled(leaf: jax.Array) -> jax.Array:
            return jnp.concatenate([leaf, jnp.repeat(leaf[-1:], missing, axis=0)])

        end = divided(*jax.tree.map(filled, (phi, state, tool, known)))

        def cut(leaf: jax.Array) -> jax.Array:
            return leaf[:candidates]

        return jax.tree.map(cut, end)

    return simulate_divided
