"""The scripted initial policy of sweeping: the stroke towards the goal that moves most of the object outside."""

from dataclasses import dataclass
from typing import NamedTuple, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

from app.core.types import Points
from app.policy.base import ActionDistribution, PlanningState

_TINY_M = 1e-6


class SweepTarget(NamedTuple):
    """Prepared once per observation: middle of the goal, and radius of the disc of the same extent [m]."""

    middle: Float32[np.ndarray, "2"]
    radius: Float32[np.ndarray, ""]


@final
@dataclass(frozen=True, kw_only=True)
class ScriptedSweep:
    """Tries strokes to the goal's middle from all sides, and takes the one with the greatest gain.

    A stroke ends `stop` of the goal's radius before the middle; the paddle, half of which is `half_m` wide and thick,
    starts up to `far_m` from there. Each particle outside the goal that lies in its way gains how far outside it is,
    and `worth_m` for being outside at all; less towards the ends of the paddle, over `edge_m`, and less the longer the
    paddle has to take it along: a share of 1/e is left after `keep_m`. Returns actions as
    `app.planner.actions.sweep_actions.Sweeps` has them.

    `angles` directions leave no gap that a paddle of 10 cm does not cover within 25 cm of the middle. To aim better is
    the planner's part.
    """

    half_m: tuple[float, float]
    gap_m: float
    stop: float = 0.8
    far_m: float = 0.36
    edge_m: float = 0.015
    worth_m: float = 0.03
    keep_m: float = 0.35
    angles: int = 16
    starts: int = 14

    def prepare(self, observed: Points, goal: Points) -> SweepTarget:
        """Middle and radius of the goal.

        The mean square distance from the middle, of points that fill a disc evenly, is half the squared radius.
        """
        del observed
        middle = goal[:, :2].mean(axis=0)
        return SweepTarget(middle, np.sqrt(2 * ((goal[:, :2] - middle) ** 2).sum(1).mean()))

    def act(self, prepared: SweepTarget, now: PlanningState) -> ActionDistribution:
        """The stroke that gains most, for each candidate."""
        angle = jnp.asarray(np.linspace(0, 2 * np.pi, self.angles, endpoint=False), jnp.float32)
        ahead = jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=-1)
        offset = now.x[..., :2] - prepared.middle
        radius = jnp.asarray(prepared.radius)

        def gains_along(way: Float[Array, "2"]) -> Float[Array, "B S"]:
            return self._gains(offset, way, radius)

        gains = jax.lax.map(gains_along, ahead)
        best = jnp.argmax(jnp.moveaxis(gains, 0, 1).reshape(len(offset), -1), axis=1)
        way, start = jnp.unravel_index(best, (self.angles, self.starts))
        ahead = ahead[way]
        end = self.stop * radius + self.half_m[1]
        begin = self._starts(radius)[start] + self.half_m[1] + self.gap_m
        ends = [prepared.middle - each * ahead for each in (begin[:, None], end)]
        return ActionDistribution.surely(jnp.concatenate(ends, axis=1))

    def _starts(self, radius: Float[Array, ""]) -> Float[Array, " S"]:
        """Distances before the middle at which the paddle's face may start [m]: from the goal's rim outwards."""
        return jnp.linspace(radius, self.far_m, self.starts)

    def _gains(
        self, offset: Float[Array, "B N 2"], ahead: Float[Array, "2"], radius: Float[Array, ""]
    ) -> Float[Array, "B S"]:
        """Expected gain of each stroke in one direction."""
        outside = jnp.sqrt((offset**2).sum(-1) + _TINY_M**2) - radius
        value = jnp.where(outside > 0, outside + self.worth_m, 0.0)
        along = -(offset * ahead).sum(-1)
        across = jnp.abs(offset[..., 1] * ahead[0] - offset[..., 0] * ahead[1])
        value = value * jnp.clip((self.half_m[0] - across) / self.edge_m, 0.0, 1.0)
        stop = self.stop * radius
        value = value * jnp.exp(-jnp.clip(along - stop, 0.0) / self.keep_m)
        reached = (along[:, None] > stop) & (along[:, None] < self._starts(radius)[:, None])
        return jnp.einsum("bn,bsn->bs", value, reached.astype(value.dtype))
