"""The scripted policy for a rod and a gap: turn it lengthwise in front of the gap, and push it through by its end."""

from dataclasses import dataclass
from typing import NamedTuple, final

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from app.core.types import Points
from app.policy.base import ActionDistribution, PlanningState

_END = 0.85
"""Contact point of a push at an end, as a share of the half length: nearer to the tip the finger slips off."""
_PIVOT = 0.414
"""A rod on a table that is pushed at its end turns about a point this share of its half length beyond its middle:
sqrt(2) - 1, from the balance of friction along it (Mason 1986, "Mechanics and Planning of Manipulator Pushing
Operations", has the centre of rotation of pushed objects in general)."""
_SMOOTH_M2 = 1e-12


class StraightRods(NamedTuple):
    """B straight rods seen from above: middles, unit vectors along them towards the gap, normals, and headings [rad].

    A heading of 0 leads along x; the normal is a quarter turn to the left of the direction.
    """

    middle: Float[Array, "B 2"]
    along: Float[Array, "B 2"]
    normal: Float[Array, "B 2"]
    heading: Float[Array, " B"]


@final
@dataclass(frozen=True, kw_only=True)
class ScriptedGap:
    """Takes whatever it sees for a rod of `half_length_m`; the gap is in a wall along y, at `gap_m` (x, y).

    A rod that leads to within `room_m` of the gap's middle, and nearly along x, is pushed by its far end along itself.
    Another one is turned by a push across one of its ends, that one which brings its middle nearer to `from_m` (x, y),
    where there is room to turn; or, if it is not turned by much, is shifted sideways by its middle. The finger starts
    `start_gap_m` beside the rod and touches it at `contact_gap_m`. Returns actions of `displacements` equal
    displacements (see `app.planner.actions.actions.Pushes`).

    Along itself a rod is pushed by `through_m` at a time: the finger slips off its end sooner or later, whichever side.
    """

    gap_m: tuple[float, float]
    from_m: tuple[float, float]
    half_length_m: float
    start_gap_m: float
    contact_gap_m: float
    max_length_m: float
    through_m: float = 0.06
    room_m: float = 0.020
    straight_rad: float = 0.25
    max_turn_rad: float = 0.9
    displacements: int = 20

    def prepare(self, observed: Points, goal: Points) -> None:
        """Prepare nothing: the place of the gap is all that is needed."""

    def act(self, prepared: None, now: PlanningState) -> ActionDistribution:
        """One push for each candidate."""
        del prepared
        rod = fit_rods(now.x[..., :2])
        ends = jnp.stack([self._through(rod), self._turning_push(rod), self._shifting_push(rod)], axis=1)
        chosen = jnp.where(self._is_aligned(rod), 0, jnp.where(jnp.abs(rod.heading) > self.straight_rad, 1, 2))
        start, way = jnp.moveaxis(jnp.take_along_axis(ends, chosen[:, None, None, None], axis=1)[:, 0], 1, 0)
        length = _length(way)[:, None]
        way = way * jnp.minimum(1.0, self.max_length_m / length)
        steps = jnp.tile(way / self.displacements, (1, self.displacements))
        return ActionDistribution.surely(jnp.concatenate([start, steps], axis=1))

    def _is_aligned(self, rod: StraightRods) -> Bool[Array, " B"]:
        """True if the rod points through the gap, or is half through."""
        ahead = self.gap_m[0] - rod.middle[:, 0]
        meets = rod.middle[:, 1] + ahead * jnp.tan(jnp.clip(rod.heading, -1.0, 1.0)) - self.gap_m[1]
        leads = (jnp.abs(rod.heading) < self.straight_rad) & (jnp.abs(meets) < self.room_m)
        return leads | ((ahead < self.half_length_m / 2) & (jnp.abs(rod.heading) < 2 * self.straight_rad))

    def _through(self, rod: StraightRods) -> Float[Array, "B 2 2"]:
        """Push along the rod, from behind its tail until that is past the wall."""
        tail = rod.middle - self.half_length_m * rod.along
        missing = jnp.maximum(self.gap_m[0] - tail[:, 0], 0.0)[:, None] + 2 * self.contact_gap_m
        length = jnp.minimum(missing, self.through_m) + self.start_gap_m - self.contact_gap_m
        return jnp.stack([tail - self.start_gap_m * rod.along, length * rod.along], axis=1)

    def _turning_push(self, rod: StraightRods) -> Float[Array, "B 2 2"]:
        """Push across one end: to the right of the head and to the left of the tail turn clockwise, and vice versa."""
        turn = jnp.clip(rod.heading, -self.max_turn_rad, self.max_turn_rad)
        side = jnp.where(turn < 0, -1.0, 1.0)[:, None]
        home = jnp.asarray(self.from_m) - rod.middle
        head = jnp.where((home * rod.normal).sum(-1)[:, None] * side < 0, 1.0, -1.0)
        at = rod.middle + head * _END * self.half_length_m * rod.along
        push = -head * side * rod.normal
        # The end goes along an arc, whose chord leads half of the turn away from the normal.
        chord = _rotate(push, -turn / 2)
        travel = (_END + _PIVOT) * self.half_length_m * jnp.abs(turn)[:, None]
        start = at - self.start_gap_m * push
        return jnp.stack([start, chord * (travel + self.start_gap_m - self.contact_gap_m)], axis=1)

    def _shifting_push(self, rod: StraightRods) -> Float[Array, "B 2 2"]:
        """Push across its middle, towards the gap's."""
        ahead = self.gap_m[0] - rod.middle[:, 0]
        missing = self.gap_m[1] - rod.middle[:, 1] - ahead * jnp.tan(jnp.clip(rod.heading, -1.0, 1.0))
        push = jnp.where(missing < 0, -1.0, 1.0)[:, None] * rod.normal
        length = jnp.abs(missing)[:, None] + self.start_gap_m - self.contact_gap_m
        return jnp.stack([rod.middle - self.start_gap_m * push, length * push], axis=1)


def fit_rods(x: Float[Array, "B N 2"]) -> StraightRods:
    """The straight rods that particles `x` [m] lie along: their principal axes, led towards +x."""
    middle = x.mean(1)
    off = x - middle[:, None]
    xx, yy, xy = (off[..., 0] ** 2).mean(1), (off[..., 1] ** 2).mean(1), (off[..., 0] * off[..., 1]).mean(1)
    heading = 0.5 * jnp.arctan2(2 * xy, xx - yy + _SMOOTH_M2)
    along = jnp.stack([jnp.cos(heading), jnp.sin(heading)], axis=-1)
    return StraightRods(middle, along, jnp.stack([-along[:, 1], along[:, 0]], axis=-1), heading)


def _rotate(vectors: Float[Array, "B 2"], angle: Float[Array, " B"]) -> Float[Array, "B 2"]:
    """Vectors rotated to the left by `angle` [rad]."""
    cos, sin, (x, y) = jnp.cos(angle), jnp.sin(angle), (vectors[:, 0], vectors[:, 1])
    return jnp.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def _length(vectors: Float[Array, "B 2"]) -> Float[Array, " B"]:
    return jnp.sqrt((vectors**2).sum(-1) + _SMOOTH_M2)
