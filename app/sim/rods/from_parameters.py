"""Physics of a rod from the simulator's parameters phi, which are the same for every engine."""

from collections.abc import Mapping, Sequence

import jax.numpy as jnp
from jaxtyping import Array, Float

from app.sim.effects.base import Effect
from app.sim.model.params import index
from app.sim.rods.rollout import RodPhysics
from app.sim.rods.scene import RodScene


def rod_physics(
    scene: RodScene, contact: Mapping[str, float | Float[Array, " B"]], phi: Float[Array, "B P"]
) -> RodPhysics:
    """Physics of a rod with phi's stiffness [Pa] and friction; `contact`: values of further fields of `RodPhysics`."""
    given = {name: jnp.broadcast_to(jnp.asarray(value, jnp.float32), len(phi)) for name, value in contact.items()}
    rigidity = phi[:, index("stiffness")] * scene.second_moment_m4
    nominal = RodPhysics.nominal(scene, len(phi))
    return nominal._replace(rigidity=rigidity, table_friction=phi[:, index("table_friction")], **given)


def rod_columns(effects: Sequence[Effect]) -> list[int]:
    """Columns of phi that a rod's simulator with these effects takes."""
    return [index(spec.name) for effect in effects for spec in effect.parameters]
