"""The scripted initial policy of pouring: carry the bowl to over the other's edge, and tilt it about its lip."""

from dataclasses import dataclass
from typing import NamedTuple, final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

from app.core.types import Points
from app.policy.base import ActionDistribution, PlanningState
from app.policy.marked_bowl import MarkedBowl

_BRIMFUL = 2.0
"""A share of the liquid that no bowl ever holds."""


class Aimed(NamedTuple):
    """Middle of what is to be filled, on the table [m], and the share of the liquid that it shall hold."""

    middle: Float32[np.ndarray, "2"]
    wanted: Float32[np.ndarray, ""]


@final
@dataclass(frozen=True, kw_only=True)
class ScriptedPour:
    """Keeps the lip, the rim's lowest point, `short_m` before the middle of the goal, and tilts on by `step_rad`.

    The bowl, whose inner radius is `radius_m`, pours along `toward` (unit, x and y), its centre `height_m` over the
    table. Until the lip is within `near_m` of where it shall be, it is tilted by no more than `carried_rad`, at which
    nothing is spilled; at `full_rad` it is empty. A shift is at most `max_shift_m`. Actions are those of `Pours`.
    Where the other bowl has a `mark`, it tilts back as soon as that holds as much as in the goal.
    """

    radius_m: float
    height_m: float
    short_m: float
    toward: tuple[float, float] = (1.0, 0.0)
    near_m: float = 0.02
    carried_rad: float = 0.25
    step_rad: float = 0.25
    full_rad: float = 1.75
    max_shift_m: float = 0.10
    mark: MarkedBowl | None = None

    def prepare(self, observed: Points, goal: Points) -> Aimed:
        """The marked bowl's middle, or the goal's."""
        del observed
        if self.mark is None:
            return Aimed(goal[:, :2].mean(axis=0).astype(np.float32), np.array(_BRIMFUL, np.float32))
        wanted = self.mark.soft_share(jnp.asarray(goal))
        return Aimed(np.asarray(self.mark.place_m[:2], np.float32), np.asarray(wanted, np.float32))

    def act(self, prepared: Aimed, now: PlanningState) -> ActionDistribution:
        """The next shift and turn, for each candidate."""
        along = jnp.asarray(self.toward)
        aim = jnp.asarray(prepared.middle) - self.short_m * along
        tilted = self._tilt(now.tool[:, 3:7])
        away = ((aim - now.tool[:, :2]) * along).sum(-1) - self.radius_m * jnp.cos(tilted)
        most = jnp.where(jnp.abs(away) < self.near_m, self.full_rad, jnp.maximum(tilted, self.carried_rad))
        wanted = jnp.minimum(tilted + self.step_rad, most)
        if self.mark is not None:
            filled = self.mark.soft_share(now.x) >= prepared.wanted
            wanted = jnp.where(filled, jnp.maximum(tilted - self.step_rad, 0.0), wanted)
        middle = aim - self.radius_m * jnp.cos(wanted)[:, None] * along
        height = jnp.full((len(wanted), 1), self.height_m)
        shift = jnp.concatenate([middle, height], axis=1) - now.tool[:, :3]
        length = jnp.sqrt((shift**2).sum(-1, keepdims=True) + 1e-16)
        shift = shift * jnp.minimum(1.0, self.max_shift_m / length)
        turn = (wanted - tilted)[:, None] * jnp.array([-self.toward[1], self.toward[0], 0.0])
        return ActionDistribution.surely(jnp.concatenate([shift, turn], axis=1))

    def _tilt(self, turn: Float[Array, "B 4"]) -> Float[Array, " B"]:
        """Tilt of the bowl's axis in the pouring direction [rad]; rotations are those of a tool that points down."""
        w, x, y, z = turn[:, 1], -turn[:, 0], -turn[:, 3], turn[:, 2]
        up = jnp.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x**2 + y**2)], axis=-1)
        return jnp.arctan2((up[:, :2] * jnp.asarray(self.toward)).sum(-1), up[:, 2])
