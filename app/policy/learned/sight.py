"""Observations of learned policies, seen or predicted: pictures of object and goal, and the tool's pose."""

from typing import NamedTuple, TypeAlias, final

import jax.numpy as jnp
from jaxtyping import Array, Float

from app.policy.base import PlanningState
from app.policy.orthographic_views import OrthographicView

Views: TypeAlias = tuple[OrthographicView, ...]
TOOL = 7
"""Numbers of a tool: its place as a share of the first view, its axis, and its opening."""
_OPEN_M = 0.1
"""An opening that counts as 1."""


@final
class PolicyObservation(NamedTuple):
    """Observation of B situations; a JAX pytree. A picture per view: the object's two channels, then the goal's."""

    pictures: tuple[Float[Array, "B R C 4"], ...]
    tool: Float[Array, "B 7"]


def sight(views: Views, goal: Float[Array, "B M 3"], now: PlanningState) -> PolicyObservation:
    """Each object [m] beside its goal [m], and the tool."""
    pairs = [(view.picture(now.x), view.picture(goal)) for view in views]
    return PolicyObservation(tuple(jnp.concatenate(both, axis=-1) for both in pairs), _tool(views[0], now.tool))


def _tool(view: OrthographicView, tool: Float[Array, "B 8"]) -> Float[Array, "B 7"]:
    low, high = jnp.array(view.low), jnp.array(view.high)
    place = 2 * (tool[:, :3] - low) / (high - low) - 1
    w, x, y, z = jnp.moveaxis(tool[:, 3:7], -1, 0)
    axis = jnp.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x**2 + y**2)], axis=-1)
    return jnp.concatenate([place, axis, tool[:, 7:] / _OPEN_M], axis=1)
