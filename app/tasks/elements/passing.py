"""A wall with a gap: its blocks, and random starts in front of it and goals behind it."""

from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np

from app.core.geometry.scene_description import Rope
from app.core.geometry.shapes.fixtures import Obstacle
from app.core.types import Points
from app.tasks.elements.base import Nodes
from app.tasks.elements.curves import fill_tube

Rectangle: TypeAlias = tuple[float, float, float, float]
_POINTS = 81


@final
@dataclass(frozen=True, kw_only=True)
class GappedWall:
    """Two blocks along y whose middle plane is at `x_m`, open between +-`gap_m` / 2, reaching to +-`reach_m` [m]."""

    x_m: float
    gap_m: float
    reach_m: float
    height_m: float
    thickness_m: float

    @property
    def blocks(self) -> tuple[Obstacle, ...]:
        """Blocks that make up the wall."""
        along, up = (self.reach_m - self.gap_m / 2) / 2, self.height_m / 2
        middle = self.gap_m / 2 + along
        half = (self.thickness_m / 2, along, up)
        return tuple(Obstacle(half_m=half, place_m=(self.x_m, side * middle, up)) for side in (-1, 1))

    def keep_out(self, beside_m: float) -> tuple[Rectangle, ...]:
        """Rectangles forbidden to a body that reaches `beside_m` from its middle: x low, y low, x high, y high [m]."""
        return tuple(
            (x - a - beside_m, y - b - beside_m, x + a + beside_m, y + b + beside_m)
            for (x, y, _), (a, b, _) in ((block.place_m, block.half_m) for block in self.blocks)
        )


@final
@dataclass(frozen=True, kw_only=True)
class Passing:
    """Problems: an object laid across in front of the wall, by seed, and a goal that leads away from the gap behind it.

    The start is drawn about `start_m` (x, y), within `start_spread_m` of it, and turned from the wall's direction by at
    most `start_turn_rad`; a rope is bent by up to `bend_rad`, which a rod is not. The goal is straight, its near end
    `goal_gap_m` behind the wall's middle plane: the farther one is at the border of where the arm may go.

    Where it is `threaded`, a share between these two of it is beyond the wall already, and `start_m` is where it passes
    the wall, in that direction but for the turn.
    """

    rope: Rope
    wall: GappedWall
    start_m: tuple[float, float]
    start_spread_m: tuple[float, float] = (0.02, 0.05)
    start_turn_rad: float = 0.5
    bend_rad: float = 0.4
    goal_gap_m: float = 0.008
    goal_turn_rad: float = 0.2
    threaded: tuple[float, float] | None = None

    def start(self, seed: int) -> Nodes:
        """The centreline in front of the wall."""
        rng = np.random.default_rng([seed, 0])
        middle = np.array(self.start_m) + rng.uniform(-1, 1, 2) * self.start_spread_m
        turn, bend = rng.uniform(-1, 1, 2) * (self.start_turn_rad, self.bend_rad)
        bend = 0.0 if self.rope.rigid else bend
        if self.threaded is None:
            return self._curve(middle, np.pi / 2 + turn, bend)
        share = 0.5 - rng.uniform(*self.threaded)
        curve = self._curve(np.zeros(2), turn - 2 * bend * share, bend)
        passes = np.array([np.interp((share + 0.5) * (_POINTS - 1), np.arange(_POINTS), each) for each in curve.T[:2]])
        return curve + np.append(middle - passes, 0.0)

    def goal(self, seed: int, particle_count: int) -> Points:
        """Goal behind the gap, pointing away from it."""
        turn = float(np.random.default_rng([seed, 1]).uniform(-1, 1)) * self.goal_turn_rad
        away = self.goal_gap_m + self.rope.length_m / 2
        middle = np.array([self.wall.x_m, 0.0]) + away * np.array([np.cos(turn), np.sin(turn)])
        return self.particles(self._curve(middle, turn, 0.0), particle_count)

    def particles(self, nodes: Nodes, particle_count: int) -> Points:
        """The tube about the centreline, filled evenly."""
        return fill_tube(nodes, self.rope.radius_m, particle_count)

    def _curve(self, middle: np.ndarray, heading: float, bend: float) -> Nodes:
        """A curve about `middle` whose heading changes by `bend` [rad] on either side of it."""
        share = (np.arange(_POINTS - 1) + 0.5) / (_POINTS - 1) - 0.5
        angle = heading + 2 * bend * share
        steps = self.rope.length_m / (_POINTS - 1) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        curve = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
        curve += middle - curve.mean(0)
        return np.concatenate([curve, np.full((_POINTS, 1), self.rope.radius_m)], axis=1)
