"""Carrying: short moves of a gripper from where it is, each with an opening to end with."""

from dataclasses import dataclass
from typing import final

import jax.numpy as jnp
import numpy as np
from jax.lax import Precision
from jaxtyping import Array, Bool, Float, Float32, Float64

from app.config import Site
from app.core.motion import Motion
from app.core.types import Points, ToolPose
from app.planner.actions.actions import Reach
from app.planner.actions.corners import corners
from app.policy.base import PlanningState
from app.policy.symmetry import Isometry

_RAMP = 0.2
"""Share of an action in which the tool speeds up, and in which it slows down again."""
_TOGGLES = 0.5
"""Share of random actions in which the gripper opens or closes on the way."""
_UPRIGHT = (1.0, 0.0, 0.0, 0.0)
"""Quaternion of a tool of the simulator that points down, as its grippers stand upright by themselves."""
_EXACT_M = 1e-5


@final
@dataclass(frozen=True, kw_only=True)
class KeptClear:
    """A rack along x that fingers do not enter: a band about `y_m`, `half_m` wide to each side, up to `top_m`."""

    y_m: float
    half_m: float
    top_m: float


@final
@dataclass(frozen=True, kw_only=True)
class Carries:
    """Eight small moves: each is a displacement (dx, dy, dz) [m] and the opening [m] that it ends with (paper, cloth).

    `low`, `high`: bounds of the point between the fingertips [m], whose lower one keeps the fingers above the table.
    `speed_m_s`: of the real arm; the simulated one makes the same way in `move_substeps`, and rests `rest_substeps`.
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    clear: KeptClear
    max_displacement_m: float
    openings_m: tuple[float, float]
    speed_m_s: float
    move_substeps: int
    rest_substeps: int
    displacement_scale_m: float = 0.0005
    opening_scale_m: float = 0.002
    moves: int = 8

    @property
    def anywhere(self) -> bool:
        """An action begins where the tool is."""
        return False

    @property
    def divisible(self) -> bool:
        """An action says how far the fingers are open."""
        return False

    @property
    def size(self) -> int:
        """Four numbers a move."""
        return 4 * self.moves

    @property
    def chunk(self) -> tuple[int, int]:
        """The moves."""
        return self.moves, 4

    @property
    def substeps(self) -> int:
        """Moving and resting."""
        return self.move_substeps + self.rest_substeps

    @property
    def reach(self) -> Reach:
        """Workspace of the fingers, and below."""
        (x0, y0, _), (x1, y1, z1) = self.low, self.high
        return (x0, y0, 0.0), (x1, y1, z1)

    def sample(self, rng: np.random.Generator, x: Points, tool: ToolPose, count: int) -> Float32[np.ndarray, "count A"]:
        """Straight towards a random particle, or from it the same way; some open or close at a random move."""
        towards = x[rng.integers(len(x), size=count)] - tool[:3]
        distance = np.linalg.norm(towards, axis=1, keepdims=True)
        ahead = np.where(rng.random((count, 1)) < 0.5, 1.0, -1.0) * towards
        ahead[:, 2] += rng.uniform(-0.5, 0.5, count) * distance[:, 0]
        ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), _EXACT_M)
        steps = np.minimum(distance / self.moves, self.max_displacement_m) * ahead
        closed, opened = self.openings_m
        is_open = tool[7] > (closed + opened) / 2
        at = np.where(rng.random(count) < _TOGGLES, rng.integers(self.moves, size=count), self.moves)
        toggled = np.arange(self.moves) >= at[:, None]
        opening = np.where(toggled != is_open, opened, closed)
        actions = np.concatenate([np.repeat(steps[:, None], self.moves, axis=1), opening[..., None]], axis=2)
        return actions.reshape(count, -1).astype(np.float32)

    def project(self, actions: Float[Array, "B A"], now: PlanningState) -> Float[Array, "B A"]:
        """Moves of bounded length that end inside the bounds and clear of the rack, one after the other."""
        wanted = actions.reshape(-1, self.moves, 4)
        here, taken = now.tool[:, :3], list[Float[Array, "B 3"]]()
        for move in range(self.moves):
            step = wanted[:, move, :3]
            step = step * jnp.minimum(1.0, self.max_displacement_m / _length(step))[:, None]
            there = self._free(here + step)
            taken.append(there - here)
            here = there
        opening = jnp.clip(wanted[..., 3:], *self.openings_m)
        return jnp.concatenate([jnp.stack(taken, axis=1), opening], axis=-1).reshape(actions.shape)

    def is_allowed(self, actions: Float[Array, "B A"], now: PlanningState) -> Bool[Array, " B"]:
        """True if every move ends inside the bounds and clear of the rack."""
        places = self._waypoints(actions, now.tool)[:, 1:, :3]
        return jnp.abs(places - self._free(places)).max((1, 2)) <= _EXACT_M

    def contains(self, places: Float64[np.ndarray, "W 3"]) -> bool:
        """True if all places [m] are inside the bounds and clear of the rack."""
        return bool(jnp.abs(places - self._free(jnp.asarray(places))).max() <= _EXACT_M)

    def scale(self) -> Float32[np.ndarray, " A"]:
        """Scale of a displacement and of an opening."""
        return np.tile(np.array([*[self.displacement_scale_m] * 3, self.opening_scale_m], np.float32), self.moves)

    def transform(self, actions: Float[Array, "B A"], by: Isometry) -> Float[Array, "B A"]:
        """The displacements; openings stay."""
        return by.directions(actions.reshape(-1, self.moves, 4)).reshape(actions.shape)

    def tool_path(self, actions: Float[Array, "B A"], tool: Float[Array, "B 8"]) -> Float[Array, "B T 8"]:
        """Straight lines between the ends of the moves, slowly at first and last, then at rest.

        In full precision: a GPU's default, TF32, would move the fingers by a quarter of a millimetre.
        """
        path = jnp.matmul(self._interpolation(), self._waypoints(actions, tool), precision=Precision.HIGHEST)
        turn = jnp.broadcast_to(jnp.array(_UPRIGHT), (*path.shape[:2], 4))
        return jnp.concatenate([path[..., :3], turn, path[..., 3:]], axis=-1)

    def after(self, actions: Float[Array, "B A"], tool: Float[Array, "B 8"]) -> Float[Array, "B 8"]:
        """Tool pose at the end of the last move."""
        last = self._waypoints(actions, tool)[:, -1]
        return jnp.concatenate([last[:, :3], tool[:, 3:7], last[:, 3:]], axis=1)

    def motion(self, action: Float32[np.ndarray, " A"], tool: ToolPose, site: Site) -> Motion:
        """Motion along the moves from the tool's pose, within the site's speed."""
        way = np.asarray(self._waypoints(jnp.asarray(action)[None], jnp.asarray(tool, jnp.float32)[None])[0])
        # Rounding to float32 may leave the bounds by a ten-millionth of a metre.
        places = np.concatenate([tool[None, :3], np.clip(way[1:, :3].astype(np.float64), self.low, self.high)])
        speeds = np.full(len(places), min(self.speed_m_s, site.limits.speed_m_s))
        return Motion(positions=places, speeds=speeds, openings=way[:, 3].astype(np.float64), continues=True)

    def measured_path(self, tool: Float[np.ndarray, "M K"]) -> Float32[np.ndarray, "T 8"]:
        """The way resampled to equal steps, an opening counting as a way, at the speeds of `tool_path`.

        Raises ValueError where nothing was measured, or positions alone.
        """
        path = self._places_and_openings(tool)
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        shares = _ease(np.minimum(np.arange(self.substeps + 1) / self.move_substeps, 1.0))
        points = np.stack([np.interp(shares * arc[-1], arc, column) for column in path.T], axis=1)
        turn = np.tile(_UPRIGHT, (len(points), 1))
        return np.concatenate([points[:, :3], turn, points[:, 3:]], axis=1).astype(np.float32)

    def measured_action(self, tool: Float[np.ndarray, "M K"]) -> Float32[np.ndarray, " A"]:
        """The way in moves that end where it turns, or fingers begin or cease to move. Raises as `measured_path`."""
        points = corners(self._places_and_openings(tool), self.moves)
        return np.concatenate([np.diff(points[:, :3], axis=0), points[1:, 3:]], axis=1).ravel().astype(np.float32)

    def _places_and_openings(self, tool: Float[np.ndarray, "M K"]) -> Float64[np.ndarray, "M 4"]:
        """Places and openings."""
        if not len(tool) or tool.shape[1] < 8:
            raise ValueError("Carrying needs measured poses with openings; the transition cannot be simulated.")
        return np.concatenate([tool[:, :3], tool[:, 7:8]], axis=1).astype(np.float64)

    def _free(self, places: Float[Array, "*axes 3"]) -> Float[Array, "*axes 3"]:
        """The nearest places inside the bounds and outside the band of the rack: above it, or beside it."""
        x, y, z = jnp.moveaxis(jnp.clip(places, jnp.asarray(self.low), jnp.asarray(self.high)), -1, 0)
        up = self.clear.top_m - z
        across = y - self.clear.y_m
        aside = self.clear.half_m - jnp.abs(across)
        inside = (up > 0) & (aside > 0)
        side = jnp.where(across < 0, -1.0, 1.0)
        y = jnp.where(inside & (aside < up), self.clear.y_m + side * self.clear.half_m, y)
        z = jnp.where(inside & (aside >= up), self.clear.top_m, z)
        return jnp.stack([x, y, z], axis=-1)

    def _waypoints(self, actions: Float[Array, "B A"], tool: Float[Array, "B 8"]) -> Float[Array, "B W 4"]:
        """Waypoints: the tool's pose and the end of each move, as x, y, z and opening."""
        moves = actions.reshape(-1, self.moves, 4)
        places = tool[:, None, :3] + jnp.cumsum(moves[..., :3], axis=1)
        ends = jnp.concatenate([places, moves[..., 3:]], axis=-1)
        return jnp.concatenate([jnp.concatenate([tool[:, None, :3], tool[:, None, 7:]], axis=-1), ends], axis=1)

    def _interpolation(self) -> Float32[np.ndarray, "T W"]:
        """Maps waypoints to places at substeps: row s holds the two weights of substep s."""
        at = _ease(np.minimum(np.arange(self.substeps + 1) / self.move_substeps, 1.0)) * self.moves
        return np.maximum(0.0, 1.0 - np.abs(at[:, None] - np.arange(self.moves + 1))).astype(np.float32)


def _ease(time: Float[np.ndarray, " T"]) -> Float[np.ndarray, " T"]:
    """The share of the way made at shares of the time: speed rises evenly, stays, and falls evenly."""
    way = np.where(time < _RAMP, time**2 / (2 * _RAMP), time - _RAMP / 2)
    return np.where(time > 1 - _RAMP, 1 - _RAMP - (1 - time) ** 2 / (2 * _RAMP), way) / (1 - _RAMP)


def _length(vectors: Float[Array, "*axes 3"]) -> Float[Array, "*axes"]:
    """Euclidean length [m] that is never zero, with a finite gradient everywhere."""
    return jnp.sqrt((vectors**2).sum(-1) + 1e-12)
