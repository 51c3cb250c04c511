"""Random smooth curves on the table: initial and goal shapes of a rope."""

from dataclasses import dataclass, field
from typing import final

import numpy as np
from jaxtyping import Float64
from scipy.stats import qmc

from app.config import Workspace
from app.core.geometry.chamfer import chamfer_m2
from app.core.geometry.scene_description import Rope
from app.core.types import Points
from app.tasks.elements.base import Nodes

_TRIES = 1000
_MIN_GAP_M = 0.04


@final
@dataclass(frozen=True, kw_only=True)
class CurveSampler:
    """Initial and goal shapes of a rope: the goal is the start, shifted, turned and bent at random.

    `gap_m` bounds how far apart start and goal are as clouds (root of half their Chamfer distance): near enough to be
    reached with about ten pushes, far enough that the rope has to move. `max_turn_rad` bounds how far a start bends,
    `min_gap_m` how near a start or a goal comes to itself.
    """

    max_shift_m: float = 0.15
    max_rotation_rad: float = 0.7
    max_bend_rad: float = 1.0
    gap_m: tuple[float, float] = (0.04, 0.10)
    workspace: Workspace = field(default_factory=Workspace)
    margin_m: float = 0.08
    max_turn_rad: float = 2.4
    min_gap_m: float = _MIN_GAP_M

    def draw(self, seed: int, rope: Rope) -> tuple[Float64[np.ndarray, "points 3"], Float64[np.ndarray, "points 3"]]:
        """Centrelines [m] of the start and the goal of problem `seed`."""
        rng = np.random.default_rng(seed)
        for _ in range(_TRIES):
            start = random_curve(
                rng,
                length_m=rope.length_m,
                height_m=rope.radius_m,
                workspace=self.workspace,
                margin_m=self.margin_m,
                max_turn_rad=self.max_turn_rad,
                min_gap_m=self.min_gap_m,
            )
            goal = self._random_goal(rng, start)
            gap_m = float(np.sqrt(chamfer_m2(start, goal) / 2))
            if self._inside(goal) and self.gap_m[0] <= gap_m <= self.gap_m[1]:
                return start, goal
        raise ValueError(f"No goal within reach in {_TRIES} tries; widen {self}.")

    def _random_goal(
        self, rng: np.random.Generator, start: Float64[np.ndarray, "points 3"]
    ) -> Float64[np.ndarray, "points 3"]:
        steps = np.diff(start[:, :2], axis=0)
        arc = np.linspace(0.0, 1.0, len(steps))
        bend = rng.uniform(-self.max_bend_rad, self.max_bend_rad, size=2) / np.array([1.0, 2.0])
        turn = rng.uniform(-1.0, 1.0) * self.max_rotation_rad
        turn = turn + bend @ np.stack([np.cos(np.pi * arc), np.cos(2 * np.pi * arc)])
        cos, sin = np.cos(turn), np.sin(turn)
        steps = np.stack([cos * steps[:, 0] - sin * steps[:, 1], sin * steps[:, 0] + cos * steps[:, 1]], axis=1)
        goal = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
        angle, shift_m = rng.uniform(0, 2 * np.pi), self.max_shift_m * np.sqrt(rng.uniform())
        goal += start[:, :2].mean(0) - goal.mean(0) + shift_m * np.array([np.cos(angle), np.sin(angle)])
        return np.concatenate([goal, start[:, 2:]], axis=1)

    def _inside(self, curve: Float64[np.ndarray, "points 3"]) -> bool:
        low = np.asarray(self.workspace.low[:2]) + self.margin_m
        high = np.asarray(self.workspace.high[:2]) - self.margin_m
        length_m = float(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum())
        gap_ok = _self_gap(curve[:, :2], length_m) >= self.min_gap_m
        return gap_ok and bool(np.all(curve[:, :2] >= low) and np.all(curve[:, :2] <= high))


@final
@dataclass(frozen=True, kw_only=True)
class RopeProblems:
    """Problems of `curves` for one rope: a world's nodes are its centreline."""

    rope: Rope
    curves: CurveSampler = field(default_factory=CurveSampler)

    def start(self, seed: int) -> Nodes:
        """The centreline at the start."""
        return self.curves.draw(seed, self.rope)[0]

    def goal(self, seed: int, particle_count: int) -> Points:
        """The rope at the end, filled evenly."""
        return self.particles(self.curves.draw(seed, self.rope)[1], particle_count)

    def particles(self, nodes: Nodes, particle_count: int) -> Points:
        """The tube about the centreline, filled evenly."""
        return fill_tube(nodes, self.rope.radius_m, particle_count)


def fill_tube(
    centreline: Float64[np.ndarray, "points 3"], radius_m: float, particle_count: int, *, seed: int = 0
) -> Points:
    """`particle_count` points [m] that fill the tube of `radius_m` about a planar curve evenly (Halton sequence)."""
    along, across, angle = qmc.Halton(3, rng=seed).random(particle_count).T
    lengths = np.linalg.norm(np.diff(centreline, axis=0), axis=1)
    arc = np.concatenate([[0.0], np.cumsum(lengths)])
    tangent = np.gradient(centreline[:, :2], arc, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    where = along * arc[-1]
    centre = np.stack([np.interp(where, arc, centreline[:, k]) for k in range(3)], axis=1)
    normal = np.stack([-np.interp(where, arc, tangent[:, 1]), np.interp(where, arc, tangent[:, 0])], axis=1)
    radius = radius_m * np.sqrt(across)
    sideways, up = radius * np.cos(2 * np.pi * angle), radius * np.sin(2 * np.pi * angle)
    points = centre + np.concatenate([sideways[:, None] * normal, up[:, None]], axis=1)
    return points.astype(np.float32)


def random_curve(
    rng: np.random.Generator,
    *,
    length_m: float,
    height_m: float,
    workspace: Workspace,
    margin_m: float = 0.08,
    max_turn_rad: float = 2.4,
    min_gap_m: float = _MIN_GAP_M,
    points: int = 81,
) -> Float64[np.ndarray, "points 3"]:
    """A planar curve of exactly `length_m` at z = `height_m`, inside the workspace less `margin_m`.

    Its heading is a random sum of two half-waves over the arc length, so its curvature is smooth; curves that come
    closer to themselves than `min_gap_m` are drawn again.
    """
    low, high = np.asarray(workspace.low[:2]) + margin_m, np.asarray(workspace.high[:2]) - margin_m
    arc = np.linspace(0.0, 1.0, points)
    for _ in range(_TRIES):
        amplitude = rng.uniform(-max_turn_rad, max_turn_rad, size=2) / np.array([1.0, 2.0])
        heading = rng.uniform(0, 2 * np.pi) + amplitude @ np.stack([np.sin(np.pi * arc), np.sin(2 * np.pi * arc)])
        middle = (heading[1:] + heading[:-1]) / 2
        steps = length_m / (points - 1) * np.stack([np.cos(middle), np.sin(middle)], axis=1)
        curve = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
        room = (high - low) - np.ptp(curve, axis=0)
        if np.any(room <= 0) or _self_gap(curve, length_m) < min_gap_m:
            continue
        curve += low - curve.min(axis=0) + rng.uniform(0, 1, 2) * room
        return np.concatenate([curve, np.full((points, 1), height_m)], axis=1)
    raise ValueError(f"No curve of {length_m} m fits the workspace in {_TRIES} tries; make it shorter.")


def _self_gap(curve: Float64[np.ndarray, "points 2"], length_m: float) -> float:
    """The smallest distance between points that lie a quarter of the length or more apart along the curve."""
    apart = max(1, int(len(curve) * 0.25))
    distance = np.linalg.norm(curve[:, None] - curve[None], axis=-1)
    i, j = np.indices(distance.shape)
    return float(distance[j - i >= apart].min(initial=length_m))
