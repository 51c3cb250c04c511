"""The cost of a sequence of actions: eq. 2 of the paper, step by step."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol, final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from app.config import KeepOut, Reach
from app.core.geometry.chamfer import chamfer_m2

_SMOOTH_M = 1e-4
_CLEAR_M = 0.005
"""Distance from keep-out volumes beyond which a path costs nothing."""


class Distance(Protocol):
    """Distance of objects from a goal; frozen and hashable, so that compiled code can be cached by it."""

    def __call__(self, x: Float[Array, "B N 3"], goal: Float[Array, "M 3"]) -> Float[Array, " B"]:
        """A squared distance [m^2], as the Chamfer distance is one."""
        ...


def straight(x: Float[Array, "B N 3"], goal: Float[Array, "M 3"]) -> Float[Array, " B"]:
    """The Chamfer distance [m^2]: nothing is in the way."""
    return chamfer_m2(x, goal[None])


@final
@dataclass(frozen=True, kw_only=True)
class Weights:
    """Weights of eq. 2: `progress` per square metre of Chamfer distance, `contact` per metre of distance.

    Each step's terms count `discount` times those of the step before. 1 is the paper's equation as printed; with it a
    branch that does nothing now and everything later costs as little as the reverse, and a planner that executes one
    action and plans again may put things off for ever. `level`: contact is measured over the table, not in space.
    `distance`: what progress is made in, where the paper has the Chamfer distance. `trespass` per metre that the tool's
    path is inside of `keep_out`, volumes that the site keeps free, which the paper has not: with 1, a path that is 1 cm
    inside throughout costs 100 cm^2 of progress. So does the way that it is out of the arm's `reach`. What still enters
    a volume, or is out of reach, is not chosen, whatever it costs.
    """

    progress: float
    contact: float
    discount: float = 1.0
    level: bool = True
    distance: Distance = straight
    trespass: float = 1.0
    keep_out: tuple[KeepOut, ...] = ()
    reach: Reach | None = None

    @property
    def has_bounds(self) -> bool:
        """True if there is any constraint to violate."""
        return bool(self.keep_out) or self.reach is not None


class Terms(NamedTuple):
    """The unweighted parts of the cost of each candidate, in m^2, m and m; each has shape (B,)."""

    progress: Float[Array, " B"]
    contact: Float[Array, " B"]
    trespass: Float[Array, " B"]

    def total(self, weights: Weights) -> Float[Array, " B"]:
        """The weighted sum that is minimised."""
        return weights.progress * self.progress + weights.contact * self.contact + weights.trespass * self.trespass

    def plus(self, other: "Terms", share: float) -> "Terms":
        """The sum of these terms and `share` of a later step's."""
        return Terms(*(mine + share * its for mine, its in zip(self, other, strict=True)))


def step_terms(
    x_before: Float[Array, "B N 3"],
    x_after: Float[Array, "B N 3"],
    goal: Float[Array, "M 3"],
    tool_path: Float[Array, "B T C"],
    weights: Weights,
) -> Terms:
    """One step's terms: chamfer(x_t, goal) - chamfer(x_{t-1}, goal), the distance between gripper and object, trespass.

    Summed over a branch the first telescopes to the final minus the initial Chamfer distance, so nothing but the end
    of the horizon and the contact terms steers, unless later steps are discounted. The paper's contact term, an L2
    distance between gripper and object, is read as the distance, horizontal where it is level, from where the tool
    ends to the nearest particle then: it draws a finger that misses the object towards it, and a push that touches pays
    about the finger's radius.
    """
    axes = 2 if weights.level else 3
    progress = weights.distance(x_after, goal) - weights.distance(x_before, goal)
    squared = ((x_after[..., :axes] - tool_path[:, -1:, :axes]) ** 2).sum(-1).min(-1)
    trespass = sum((_inside_m(tool_path, volume) for volume in weights.keep_out), jnp.zeros(len(x_after)))
    if weights.reach is not None:
        trespass = trespass + _beyond_m(tool_path, weights.reach)
    return Terms(progress, jnp.sqrt(squared + _SMOOTH_M**2), trespass)


def _inside_m(tool_path: Float[Array, "B T C"], volume: KeepOut) -> Float[Array, " B"]:
    """Mean penetration of the path into the volume [m], by the shortest way out sideways.

    A tool comes from above and leaves upwards, so over the table a volume counts from its top down.
    """
    low, high = np.asarray(volume.low) - _CLEAR_M, np.asarray(volume.high) + _CLEAR_M
    sideways = jnp.minimum(tool_path[..., :2] - low[:2], high[:2] - tool_path[..., :2]).min(-1)
    return jnp.where(tool_path[..., 2] < high[2], jnp.maximum(sideways, 0.0), 0.0).mean(-1)


def _beyond_m(tool_path: Float[Array, "B T C"], reach: Reach) -> Float[Array, " B"]:
    """Mean distance of the path beyond the arm's reach [m], of a tool that points down."""
    from_shoulder = tool_path[..., :3] + jnp.array([0.0, 0.0, reach.hand_m]) - jnp.array(reach.middle)
    away = jnp.sqrt((from_shoulder**2).sum(-1) + _SMOOTH_M**2)
    return jnp.maximum(away - (reach.radius_m - _CLEAR_M), 0.0).mean(-1)
