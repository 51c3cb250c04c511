"""Sweeps: straight strokes of an upright paddle over the table, as in the paper's bean sweeping."""

from dataclasses import dataclass
from typing import final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32

from app.config import Site
from app.core.motion import Motion
from app.core.types import Points, ToolPose
from app.planner.actions.actions import LOW_ENOUGH_M, ON_TABLE_M, Reach
from app.policy.base import PlanningState
from app.policy.random_sweeps import yaw_across
from app.policy.symmetry import Isometry

_SAMPLES_PER_BRANCH = 32
_SHIFT_STEP_M = 0.004
"""Step of the search for a clear place of the paddle: half of the usual clearance."""
_ROUNDING_M = 1e-4
_SMOOTH_M = 1e-6
"""A length that is none."""


@final
@dataclass(frozen=True, kw_only=True)
class Sweeps:
    """Straight down onto free table, a straight sweep with the paddle turned across it, straight up again.

    An action is 4 numbers: where the middle of the paddle starts and ends, x0 y0 x1 y1 [m] (paper, bean sweeping). The
    tool path of the simulator leaves out descent and lift, which touch nothing: a start is allowed only where the
    paddle comes down `clearance_m` or more beside every particle.

    `region`: bounds (x low, y low, x high, y high) [m] of the paddle's middle; `half_m`: half its width and half its
    thickness; `length_m`: the shortest and the longest sweep; `reach_m`: how far back and how far ahead along the sweep
    a start may be moved to come free. `speed_m_s`, `approach_m_s`: of the real arm, along the sweep and above it.
    The simulated sweep takes `sweep_substeps` whatever its length, and `rest_substeps` more.
    """

    region: tuple[float, float, float, float]
    height_m: float
    half_m: tuple[float, float]
    clearance_m: float
    length_m: tuple[float, float]
    random_length_m: tuple[float, float]
    speed_m_s: float
    approach_m_s: float
    sweep_substeps: int
    rest_substeps: int
    reach_m: tuple[float, float] = (0.12, 0.06)
    scale_m: float = 0.006

    @property
    def anywhere(self) -> bool:
        """An action begins beside the object, wherever the tool was."""
        return True

    @property
    def divisible(self) -> bool:
        """An action says where it begins."""
        return False

    @property
    def size(self) -> int:
        """Start and end."""
        return 4

    @property
    def chunk(self) -> tuple[int, int]:
        """Start and end."""
        return 2, 2

    @property
    def substeps(self) -> int:
        """Sweeping and resting."""
        return self.sweep_substeps + self.rest_substeps

    @property
    def reach(self) -> Reach:
        """Workspace of the paddle, on the table."""
        x0, y0, x1, y1 = self.region
        return (x0, y0, 0.0), (x1, y1, ON_TABLE_M)

    def sample(self, rng: np.random.Generator, x: Points, tool: ToolPose, count: int) -> Float32[np.ndarray, "count 4"]:
        """A random particle and a random angle: the sweep starts behind the particle and goes straight through it.

        The least bad of many are taken: what is bad is a start outside the region or on top of a particle, and no
        room for the sweep.
        """
        del tool
        tries = _SAMPLES_PER_BRANCH * count
        through = x[rng.integers(len(x), size=tries), :2].astype(np.float64)
        angle = rng.uniform(0, 2 * np.pi, tries)
        ahead = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        start = through - (self.half_m[1] + 1.3 * self.clearance_m) * ahead
        low, high = self._bounds()
        room = np.asarray(self._room(jnp.asarray(start), jnp.asarray(ahead)))
        length = np.minimum(rng.uniform(*self.random_length_m, size=tries), room)
        outside = np.maximum(low - start, start - high).max(1).clip(min=0)
        gap = np.asarray(_gap(jnp.asarray(x[None, :, :2] - start[:, None]), jnp.asarray(ahead), self.half_m).min(1))
        badness = outside + (self.clearance_m - gap).clip(min=0) + (self.length_m[0] - length).clip(min=0)
        chosen = np.argsort(badness, kind="stable")[:count]
        return np.concatenate([start, start + length[:, None] * ahead], axis=1)[chosen].astype(np.float32)

    def project(self, actions: Float[Array, "B 4"], now: PlanningState) -> Float[Array, "B 4"]:
        """Project both ends into the region, the length to its bounds, and the start along the sweep to a free place.

        Where no place within reach is free, or the region leaves no room for the sweep, `allowed` says so.
        """
        low, high = self._bounds()
        start, end = jnp.clip(actions[:, :2], low, high), jnp.clip(actions[:, 2:], low, high)
        ahead, length = _heading(end - start)
        length = jnp.clip(length, *self.length_m)
        end = start + length[:, None] * ahead
        start = jnp.clip(start + self._shift(start, ahead, length, now.x[..., :2])[:, None] * ahead, low, high)
        length = jnp.clip(((end - start) * ahead).sum(-1), *self.length_m)
        end = start + jnp.minimum(length, self._room(start, ahead))[:, None] * ahead
        return jnp.concatenate([start, end], axis=1)

    def is_allowed(self, actions: Float[Array, "B 4"], now: PlanningState) -> Bool[Array, " B"]:
        """True if the paddle comes down beside the object (within a tenth of a millimetre), and moves at all."""
        low, high = self._bounds()
        start, end = actions[:, :2], actions[:, 2:]
        ahead, length = _heading(end - start)
        inside = jnp.all((start >= low - _ROUNDING_M) & (start <= high + _ROUNDING_M), axis=-1)
        gap = _gap(now.x[..., :2] - start[:, None], ahead, self.half_m).min(-1)
        return inside & (gap >= self.clearance_m - _ROUNDING_M) & (length >= self.length_m[0] - _ROUNDING_M)

    def scale(self) -> Float32[np.ndarray, "4"]:
        """The same for all."""
        return np.full(4, self.scale_m, np.float32)

    def transform(self, actions: Float[Array, "B 4"], by: Isometry) -> Float[Array, "B 4"]:
        """Both ends, transformed."""
        return by.places(actions.reshape(-1, 2, 2)).reshape(actions.shape)

    def ends(self, actions: Float[Array, "B 4"]) -> Float[Array, "B 2 2"]:
        """Start and end of a sweep [m]."""
        return actions.reshape(-1, 2, 2)

    def bends(self, actions: Float[Array, "B 4"]) -> Float[Array, "B 0"]:
        """None: a sweep is straight."""
        return jnp.zeros((len(actions), 0))

    def stroke(self, ends: Float[Array, "B 2 2"], bends: Float[Array, "B 0"]) -> Float[Array, "B 4"]:
        """The sweep from end to end."""
        del bends
        return ends.reshape(-1, 4)

    def tool_path(self, actions: Float[Array, "B 4"], tool: Float[Array, "B 8"]) -> Float[Array, "B T 7"]:
        """Path from start to end, slowly at first and last, then at rest; quaternions of the upright paddle."""
        del tool
        start, end = actions[:, None, :2], actions[:, None, 2:]
        level = start + self._progress()[:, None] * (end - start)
        angle = _yaw(end - start) / 2
        zero = jnp.zeros_like(angle)
        turn = jnp.stack([jnp.cos(angle), zero, zero, jnp.sin(angle)], axis=-1)
        height = jnp.full((*level.shape[:2], 1), self.height_m, level.dtype)
        return jnp.concatenate([level, height, jnp.broadcast_to(turn, (*level.shape[:2], 4))], axis=-1)

    def after(self, actions: Float[Array, "B 4"], tool: Float[Array, "B 8"]) -> Float[Array, "B 8"]:
        """The tool's pose, unchanged: it does not matter to the next sweep."""
        del actions
        return tool

    def motion(self, action: Float32[np.ndarray, "4"], tool: ToolPose, site: Site) -> Motion:
        """Motion from above the start down, along the sweep, and up; yawed by the lesser angle that is across it."""
        del tool
        start, end = np.asarray(action[:2], np.float64), np.asarray(action[2:], np.float64)
        angle = yaw_across(end - start) / 2
        heights = (site.travel_height_m, self.height_m, self.height_m, site.travel_height_m)
        places = zip((start, start, end, end), heights, strict=True)
        return Motion(
            positions=np.array([[*place, height] for place, height in places]),
            speeds=np.minimum(
                [self.approach_m_s, self.approach_m_s, self.speed_m_s, self.approach_m_s], site.limits.speed_m_s
            ),
            turns=np.tile([0.0, np.cos(angle), np.sin(angle), 0.0], (4, 1)),
        )

    def measured_path(self, tool: Float[np.ndarray, "M K"]) -> Float32[np.ndarray, "T 7"]:
        """The straight line between the ends of the way near sweep height, or near its lowest point above that.

        Raises ValueError where nothing was measured.
        """
        start, end = self.measured_action(tool).reshape(2, 2)
        way = end - start
        path = np.zeros((self.substeps + 1, 7))
        path[:, :2] = start + self._progress()[:, None] * way
        path[:, 2] = max(self.height_m, float(tool[:, 2].min()))
        angle = (np.arctan2(way[1], way[0]) - np.pi / 2) / 2
        path[:, 3], path[:, 6] = np.cos(angle), np.sin(angle)
        return path.astype(np.float32)

    def measured_action(self, tool: Float[np.ndarray, "M K"]) -> Float32[np.ndarray, "4"]:
        """The ends of that line. Raises ValueError where nothing was measured."""
        if not len(tool):
            raise ValueError("No tool positions were measured; the transition cannot be simulated.")
        heights = tool[:, 2]
        low = tool[heights < max(self.height_m, float(heights.min())) + LOW_ENOUGH_M]
        return low[[0, -1], :2].ravel().astype(np.float32)

    def _shift(
        self,
        start: Float[Array, "B 2"],
        ahead: Float[Array, "B 2"],
        length: Float[Array, " B"],
        x: Float[Array, "B N 2"],
    ) -> Float[Array, " B"]:
        """Shift [m] of the start along the sweep to the nearest place where the paddle is free."""
        back, forth = (round(reach / _SHIFT_STEP_M) for reach in self.reach_m)
        shifts = _SHIFT_STEP_M * np.arange(-back, forth + 1)
        low, high = self._bounds()

        def cost(shift: Float[Array, ""]) -> Float[Array, " B"]:
            at = start + shift * ahead
            outside = jnp.maximum(low - at, at - high).max(-1).clip(0)
            gap = _gap(x - at[:, None], ahead, self.half_m).min(-1)
            short = (self.length_m[0] - (length - shift)).clip(0)
            wrong = outside + short + (self.clearance_m - gap).clip(0)
            # What is wrong by a rounding error is as good as free; else the least wrong place is nearest.
            return jnp.abs(shift) + jnp.where(wrong > _ROUNDING_M / 2, 1.0 + 10.0 * wrong, 0.0)

        costs = jax.lax.map(cost, jnp.asarray(shifts, start.dtype))
        return jnp.asarray(shifts, start.dtype)[jnp.argmin(costs, axis=0)]

    def _room(self, start: Float[Array, "B 2"], ahead: Float[Array, "B 2"]) -> Float[Array, " B"]:
        """Distance [m] ahead from a start in the region to its bounds; a metre or more along one of them."""
        low, high = self._bounds()
        slope = jnp.where(jnp.abs(ahead) < _SMOOTH_M, _SMOOTH_M, ahead)
        return ((jnp.where(slope > 0, high + _SMOOTH_M, low - _SMOOTH_M) - start) / slope).min(-1).clip(0)

    def _progress(self) -> Float32[np.ndarray, " T"]:
        """The share of the way made at each substep; the speed rises and falls like sin^2."""
        time = np.minimum(np.arange(self.substeps + 1) / self.sweep_substeps, 1.0)
        return (time - np.sin(2 * np.pi * time) / (2 * np.pi)).astype(np.float32)

    def _bounds(self) -> tuple[Float32[np.ndarray, "2"], Float32[np.ndarray, "2"]]:
        return np.asarray(self.region[:2], np.float32), np.asarray(self.region[2:], np.float32)


def _heading(way: Float[Array, "B 2"]) -> tuple[Float[Array, "B 2"], Float[Array, " B"]]:
    """Direction and length [m]; along x where there is no way at all."""
    length = jnp.sqrt((way**2).sum(-1))
    known = length > _SMOOTH_M
    ahead = jnp.where(known[:, None], way / jnp.where(known, length, 1.0)[:, None], jnp.array([1.0, 0.0]))
    return ahead, length


def _yaw(way: Float[Array, "*axes 2"]) -> Float[Array, "*axes"]:
    """Yaw [rad] of a paddle that goes in a direction."""
    return jnp.arctan2(way[..., 1], way[..., 0]) - jnp.pi / 2


def _gap(offset: Float[Array, "B N 2"], ahead: Float[Array, "B 2"], half_m: tuple[float, float]) -> Float[Array, "B N"]:
    """Distance [m] of points, given from the middle of a paddle that goes `ahead`, to its outline; negative inside."""
    x, y, along, across = offset[..., 0], offset[..., 1], ahead[:, None, 0], ahead[:, None, 1]
    before, beside = jnp.abs(x * along + y * across) - half_m[1], jnp.abs(x * across - y * along) - half_m[0]
    outside = jnp.sqrt(jnp.maximum(before, 0.0) ** 2 + jnp.maximum(beside, 0.0) ** 2)
    return outside + jnp.minimum(jnp.maximum(before, beside), 0.0)
