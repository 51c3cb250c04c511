"""The scripted initial policy for a cloth: take its edge, pull it over the rack, and let go when half is beyond."""

from dataclasses import dataclass
from typing import NamedTuple, final

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from app.core.types import Points
from app.policy.base import ActionDistribution, PlanningState

_NEAR_MIDDLE_M = 0.02
"""Particles this near to the line through the cloth's middle tell where its edge is there."""
_IN_HAND_M = 0.045
"""Distance of a particle from a closed gripper that holds it: its own fingers hide nearer ones."""
_DOWN_M = 0.01
"""Fingers as near as this to the height of a grasp have come down for one."""
_DRAWN = 0.05
"""Share of the cloth on one side of the rack above which a cloth held on the other is drawn over it."""
_COARSE = 1e-6


class Heading(NamedTuple):
    """Prepared once per observation: the place along the rack where the cloth shall hang [m]."""

    x_m: Float[Array, ""]


@final
@dataclass(frozen=True, kw_only=True)
class ScriptedCarry:
    """Waypoint policy of the gripper from its present pose, followed in moves of bounded length.

    A cloth that hangs by the middle of an edge hangs straight, and pulled across the rods it lays itself over them. The
    edge is that towards the rack, the point on it that on the line through the cloth's middle. What is in hand goes up
    to `carry_m`, over the rack and `beyond_m` past its middle, at `release_m` over the table, and is let go there.

    `rack_y_m`: middle of the rack; `half_m`: half of the band that the fingers keep out of; `low_m`: fingers
    that grasp; `inset_m`: from the edge; `openings_m`: closed and open; `steps_m`: the longest move and the greatest
    change of the opening in one. Returns actions of `moves` moves (see `app.planner.actions.carry_actions.Carries`).
    """

    rack_y_m: float
    half_m: float
    low_m: float
    approach_m: float
    carry_m: float
    beyond_m: float
    release_m: float
    inset_m: float
    openings_m: tuple[float, float]
    steps_m: tuple[float, float]
    moves: int = 8

    def prepare(self, observed: Points, goal: Points) -> Heading:
        """The goal's middle."""
        del observed
        return Heading(jnp.asarray(goal[:, 0].mean()))

    def act(self, prepared: Heading, now: PlanningState) -> ActionDistribution:
        """The next moves of each candidate."""
        ways = jax.vmap(self._way, in_axes=(None, 0, 0))(prepared.x_m, now.x, now.tool)
        return ActionDistribution.surely(jax.vmap(self._first_moves)(ways))

    def _way(self, x_m: Float[Array, ""], x: Float[Array, "N 3"], tool: Float[Array, " 8"]) -> Float[Array, "W 4"]:
        """Waypoints still ahead of the tool: x, y, z and opening."""
        here = jnp.concatenate([tool[:3], tool[7:]])
        closed, opened = self.openings_m
        near = jnp.sqrt(((x - tool[:3]) ** 2).sum(-1)).min() < _IN_HAND_M
        held = near & (tool[7] < (closed + opened) / 2)
        side = jnp.where(held, self._onwards(x, tool[1]), jnp.where(x[:, 1].mean() < self.rack_y_m, 1.0, -1.0))
        # Over the edge, low and open, the gripper hides the very edge from the cameras: it closes where it came to.
        come = near & (tool[2] < self.low_m + _DOWN_M)
        edge = jnp.where(come, tool[:2], self._edge(x, side))
        carried = self._carry_waypoints(here, held, edge, x_m, side)
        to_it = self._taking(here, held, edge)
        away = jnp.concatenate([here[:2], jnp.array([self.carry_m, opened])])
        hung = self._hangs(x) & ~held
        way = jnp.concatenate([here[None], to_it, carried])
        return jnp.where(hung, jnp.concatenate([here[None], jnp.tile(away, (len(way) - 1, 1))]), way)

    def _onwards(self, x: Float[Array, "N 3"], tool_y: Float[Array, ""]) -> Float[Array, ""]:
        """The side (1 or -1) to which the held cloth is carried: beyond the rack, from the side of most of it.

        A gripper that is beyond the rack and has drawn the cloth along goes on, wherever the cloth's middle is by now;
        one before it may have a cloth that swung ahead over the first rod.
        """
        before = (x[:, 1] < self.rack_y_m).mean()
        return jnp.where(jnp.where(tool_y < self.rack_y_m, before > 0.3, before > _DRAWN), 1.0, -1.0)

    def _edge(self, x: Float[Array, "N 3"], side: Float[Array, ""]) -> Float[Array, " 2"]:
        """Grasp point on the cloth (x, y): its edge towards the rack, on the line through its middle."""
        middle = x[:, 0].mean()
        nearness = jnp.where(jnp.abs(x[:, 0] - middle) < _NEAR_MIDDLE_M, side * x[:, 1], -jnp.inf)
        y = side * nearness.max()
        return jnp.stack([middle, jnp.where(jnp.isfinite(y), y, x[:, 1].mean()) - side * self.inset_m])

    def _taking(self, here: Float[Array, " 4"], held: Bool[Array, ""], edge: Float[Array, " 2"]) -> Float[Array, "W 4"]:
        """Grasp waypoints: up, over the edge, down to it, and close; none if it is held."""
        closed, opened = self.openings_m
        beyond = (here[1] - self.rack_y_m) * (edge[1] - self.rack_y_m) < 0
        height = jnp.where(beyond, self.carry_m, self.approach_m)
        up = jnp.concatenate([here[:2], jnp.maximum(here[2:3], height), jnp.array([opened])])
        above = jnp.concatenate([edge, height[None], jnp.array([opened])])
        down = jnp.concatenate([edge, jnp.array([self.low_m, opened])])
        there = jnp.abs(here[:2] - edge).max() < self.inset_m
        # A gripper that is over the edge already goes straight down.
        up, above = (jnp.where(there, here.at[3].set(opened), each) for each in (up, above))
        taken = down.at[3].set(closed)
        return jnp.where(held, here, jnp.stack([up, above, down, taken]))

    def _carry_waypoints(
        self,
        here: Float[Array, " 4"],
        held: Bool[Array, ""],
        edge: Float[Array, " 2"],
        x_m: Float[Array, ""],
        side: Float[Array, ""],
    ) -> Float[Array, "W 4"]:
        """Carry waypoints: up, over the rack, down beyond it, open, and up."""
        closed, opened = self.openings_m
        start = jnp.where(held, here[:2], edge)
        passed = side * (start[1] - self.rack_y_m) > -self.half_m / 2
        far = self.rack_y_m + side * self.beyond_m
        up = jnp.concatenate([start, jnp.array([self.carry_m, closed])])
        up = jnp.where(held & passed, here, up)
        over = jnp.stack([x_m, self.rack_y_m, self.carry_m, closed])
        over = jnp.where(held & passed, here, over)
        let_go = jnp.stack([x_m, far, self.release_m, closed])
        opening = let_go.at[3].set(opened)
        return jnp.stack([up, over, let_go, opening, opening.at[2].set(self.carry_m)])

    def _hangs(self, x: Float[Array, "N 3"]) -> Bool[Array, ""]:
        """True if the cloth is over the rack, with a fifth of it at least on either side."""
        up = x[:, 2] > self.approach_m / 2
        before = (up & (x[:, 1] < self.rack_y_m)).mean()
        return (jnp.minimum(before, up.mean() - before) > 0.2) & (up.mean() > 0.6)

    def _first_moves(self, way: Float[Array, "W 4"]) -> Float[Array, " A"]:
        """The first moves along the waypoints, none longer than allowed, each segment in equal ones."""
        steps = jnp.diff(way, axis=0)
        far, opening = self.steps_m
        length = jnp.sqrt((steps[:, :3] ** 2).sum(-1))
        count = jnp.ceil(jnp.maximum(length / far, jnp.abs(steps[:, 3]) / opening) - _COARSE)
        ends = jnp.cumsum(count)
        move = jnp.arange(1, self.moves + 1)
        segment = jnp.minimum(jnp.searchsorted(ends, move), len(steps) - 1)
        share = 1.0 - (ends[segment] - move) / jnp.maximum(count[segment], 1.0)
        places = way[segment] + jnp.clip(share, 0.0, 1.0)[:, None] * steps[segment]
        moves = jnp.diff(places[:, :3], axis=0, prepend=way[:1, :3])
        return jnp.concatenate([moves, places[:, 3:]], axis=1).reshape(-1)
