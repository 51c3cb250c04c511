"""Actions: flat vectors of numbers and the tool paths they mean, as JAX functions so that gradients reach them."""

from dataclasses import dataclass
from typing import Protocol, TypeAlias, final

import jax
import jax.numpy as jnp
import numpy as np
from jax.lax import Precision
from jaxtyping import Array, Bool, Float, Float32, Float64, Int

from app.config import Site
from app.core.geometry.finger_distance import extent_m, from_core, nearest_m
from app.core.motion import Motion
from app.core.types import Points, ToolPose
from app.policy.base import PlanningState
from app.policy.symmetry import Isometry

_CLEARING_STEPS = 12
"""Steps that free a start: between the parts of a curled rope it needs a few, alone beside one two."""
_SAMPLES_PER_BRANCH = 64
_CLOSE_M = 1e-4
"""Tolerance on an allowed push's distance: rounding by the projection."""
LOW_ENOUGH_M = 0.004
"""A measured tip this far above the push height is down: below the top of any object that the finger pushes."""


Reach: TypeAlias = tuple[tuple[float, float, float], tuple[float, float, float]]
ON_TABLE_M = 0.05
"""Height below which an object pushed along a table stays: its middle is no higher."""


class ActionSpace(Protocol):
    """The actions of a task. B candidates, A numbers of an action, N particles, T tool positions a substep apart.

    C are the coordinates of the scene's tools (`app.sim.tools.base.Motion`). An action may begin where the tool is, as
    carrying does, or anywhere, as pushing does.
    """

    @property
    def size(self) -> int:
        """A."""
        ...

    @property
    def chunk(self) -> tuple[int, int]:
        """T small moves of K numbers each, in which an action may be thought of: A = T K."""
        ...

    @property
    def substeps(self) -> int:
        """S: simulated substeps an action takes."""
        ...

    @property
    def anywhere(self) -> bool:
        """True if an action may begin anywhere, so that the tool's pose does not matter."""
        ...

    @property
    def divisible(self) -> bool:
        """True if a share of an action is a part of it: all of its numbers say how far to go from where the tool is."""
        ...

    @property
    def reach(self) -> Reach:
        """Lower and upper corner of where actions can bring the middle of an object [m]."""
        ...

    def sample(self, rng: np.random.Generator, x: Points, tool: ToolPose, count: int) -> Float32[np.ndarray, "count A"]:
        """Random allowed actions for the object `x` and the tool there, as the paper draws first actions."""
        ...

    def project(self, actions: Float[Array, "B A"], now: PlanningState) -> Float[Array, "B A"]:
        """The nearest actions, or nearly so, that are allowed now."""
        ...

    def is_allowed(self, actions: Float[Array, "B A"], now: PlanningState) -> Bool[Array, " B"]:
        """True if projection succeeded: the arm may start there."""
        ...

    def scale(self) -> Float32[np.ndarray, " A"]:
        """Typical change of each number: the unit of one step of gradient descent."""
        ...

    def transform(self, actions: Float[Array, "B A"], by: Isometry) -> Float[Array, "B A"]:
        """The same actions after the table and all on it is moved by an isometry."""
        ...

    def tool_path(self, actions: Float[Array, "B A"], tool: Float[Array, "B 8"]) -> Float[Array, "B T C"]:
        """The tools' coordinates at the ends of all substeps, from poses `tool` on; the first three are a place [m]."""
        ...

    def after(self, actions: Float[Array, "B A"], tool: Float[Array, "B 8"]) -> Float[Array, "B 8"]:
        """Tool poses after the actions."""
        ...

    def motion(self, action: Float32[np.ndarray, " A"], tool: ToolPose, site: Site) -> Motion:
        """Motion of the arm, with its tool there, that makes the action."""
        ...

    def measured_path(self, tool: Float[np.ndarray, "M K"]) -> Float32[np.ndarray, "T C"]:
        """The tool path to simulate for an action that was made along measured poses of the tool.

        Of those K = 8 numbers are known, or the first 3, the position, where the actions need no more.
        """
        ...

    def measured_action(self, tool: Float[np.ndarray, "M K"]) -> Float32[np.ndarray, " A"]:
        """The action that was made along measured poses, as `measured_path` takes them: what demonstrations teach."""
        ...


@final
@dataclass(frozen=True, kw_only=True)
class Pushes:
    """Straight down beside the object, a push along 20 short displacements, straight up again.

    An action is 42 numbers: start (x0, y0), then 20 displacements (dx, dy), all in metres (paper, rope pushing).
    The tool path of the simulator leaves out descent and lift, which touch nothing: a
    start is allowed only where the finger comes down `clearance_m` or more beside every particle.

    `region`: bounds (x low, y low, x high, y high) [m] of the finger; `keep_out`: rectangles, told alike, which it does
    not enter: what stands there, and beyond it the finger's radius and a displacement at a corner. A push that would
    slides along them. `rest_substeps`: substeps at rest after the push;
    `speed_m_s`, `approach_m_s`: of the real arm, along the push and above it; the simulated finger is faster, which a
    quasi-static object does not mind.
    """

    region: tuple[float, float, float, float]
    height_m: float
    clearance_m: float
    max_displacement_m: float
    max_length_m: float
    random_length_m: tuple[float, float]
    speed_m_s: float
    approach_m_s: float
    push_substeps: int
    rest_substeps: int
    start_scale_m: float = 0.004
    displacement_scale_m: float = 0.001
    displacements: int = 20
    keep_out: tuple[tuple[float, float, float, float], ...] = ()
    core_m: tuple[float, float] = (0.0, 0.0)
    """Vector from a flat finger's middle to an end of its core (`Finger.half_m`), beside which the object is."""

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
        """Two numbers of start and two a displacement."""
        return 2 + 2 * self.displacements

    @property
    def chunk(self) -> tuple[int, int]:
        """The start, and each displacement."""
        return 1 + self.displacements, 2

    @property
    def substeps(self) -> int:
        """Pushing and resting."""
        return self.push_substeps + self.rest_substeps

    @property
    def reach(self) -> Reach:
        """Workspace of the finger, on the table."""
        x0, y0, x1, y1 = self.region
        return (x0, y0, 0.0), (x1, y1, ON_TABLE_M)

    def sample(self, rng: np.random.Generator, x: Points, tool: ToolPose, count: int) -> Float32[np.ndarray, "count A"]:
        """A random particle and a random angle: the push starts beside the object and goes straight through both.

        Starts on top of the object or outside the region are drawn again; where none is left (a rope curled up
        tightly) the least bad ones are kept, for projection to mend.
        """
        del tool
        tries = _SAMPLES_PER_BRANCH * count
        through = x[rng.integers(len(x), size=tries), :2].astype(np.float64)
        angle = rng.uniform(0, 2 * np.pi, tries)
        direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        start = through - (1.3 * self.clearance_m + extent_m(direction, self.core_m))[:, None] * direction
        length = rng.uniform(*self.random_length_m, size=(tries, 1))
        low, high = self._bounds()
        outside = np.maximum(low - start, start - high).max(1).clip(min=0)
        near = nearest_m(start, x[:, :2], self.core_m)
        hindered = np.linalg.norm(self._outside(jnp.asarray(start)) - start, axis=1)
        badness = outside + hindered + (self.clearance_m - near).clip(min=0)
        chosen = np.argsort(badness, kind="stable")[:count]
        steps = np.repeat((length * direction / self.displacements)[chosen, None], self.displacements, axis=1)
        return np.concatenate([start[chosen], steps.reshape(count, -1)], axis=1).astype(np.float32)

    def project(self, actions: Float[Array, "B A"], now: PlanningState) -> Float[Array, "B A"]:
        """Bounded displacements and length, a start beside the object, every waypoint inside the region.

        The start moves away from the nearest particle, again and again; between two close parts of a rope that may
        end nowhere, which `allowed` tells.
        """
        start, steps = self._split(actions)
        start = self._clear(start, now.x[..., :2])
        size = _length(steps)
        steps = steps * jnp.minimum(1.0, self.max_displacement_m / size)[..., None]
        total = _length(steps).sum(-1)
        steps = steps * jnp.minimum(1.0, self.max_length_m / total)[:, None, None]
        low, high = self._bounds()
        points = jnp.clip(start[:, None] + jnp.cumsum(steps, axis=1), low, high)
        if self.keep_out:
            points = self._slid(start, steps)
        return self._join(start, jnp.diff(points, axis=1, prepend=start[:, None]))

    def is_allowed(self, actions: Float[Array, "B A"], now: PlanningState) -> Bool[Array, " B"]:
        """True if the finger comes down beside the object (within a tenth of a millimetre) and inside the region.

        It must also enter no keep-out rectangle.
        """
        start, _ = self._split(actions)
        low, high = self._bounds()
        inside = jnp.all((start >= low - 1e-6) & (start <= high + 1e-6), axis=-1)
        beside = _length(from_core(start[:, None] - now.x[..., :2], self.core_m)).min(-1) >= self.clearance_m - _CLOSE_M
        if not self.keep_out:
            return inside & beside
        way = self._waypoints(actions)
        return inside & beside & (_length(self._outside(way) - way).max(-1) <= _CLOSE_M)

    def scale(self) -> Float32[np.ndarray, " A"]:
        """A start may move further in a step than a displacement, as all displacements add up."""
        return np.repeat(
            np.array([self.start_scale_m, self.displacement_scale_m], np.float32), [2, 2 * self.displacements]
        )

    def transform(self, actions: Float[Array, "B A"], by: Isometry) -> Float[Array, "B A"]:
        """The start as a place, displacements as directions."""
        start, steps = self._split(actions)
        return self._join(by.places(start), by.directions(steps))

    def ends(self, actions: Float[Array, "B A"]) -> Float[Array, "B 2 2"]:
        """Start and end of a push [m]."""
        return self._waypoints(actions)[:, [0, -1]]

    def bends(self, actions: Float[Array, "B A"]) -> Float[Array, "B M"]:
        """Each displacement as shares of the way from end to end, along it and across it."""
        ends, (_, steps) = self.ends(actions), self._split(actions)
        frame = _frame(ends[:, 1] - ends[:, 0])
        return jnp.einsum("bij,bki->bkj", frame, steps, precision=Precision.HIGHEST).reshape(len(actions), -1)

    def stroke(self, ends: Float[Array, "B 2 2"], bends: Float[Array, "B M"]) -> Float[Array, "B A"]:
        """The push of these ends that bends so; what the bends leave open is made up for by all displacements."""
        way = ends[:, 1] - ends[:, 0]
        shares = bends.reshape(len(bends), self.displacements, 2)
        missing = jnp.array([1.0, 0.0]) - shares.sum(1)
        shares = shares + missing[:, None] / self.displacements
        steps = jnp.einsum("bij,bkj->bki", _frame(way), shares, precision=Precision.HIGHEST)
        return self._join(ends[:, 0], steps * (way**2).sum(-1)[:, None, None])

    def tool_path(self, actions: Float[Array, "B A"], tool: Float[Array, "B 8"]) -> Float[Array, "B T 3"]:
        """Straight lines between the waypoints, slowly at first and last, then at rest; all at the push height.

        In full precision: a GPU's default, TF32, would move the finger by a quarter of a millimetre.
        """
        del tool
        path = jnp.matmul(self._interpolation(), self._waypoints(actions), precision=Precision.HIGHEST)
        height = jnp.full((*path.shape[:2], 1), self.height_m, path.dtype)
        return jnp.concatenate([path, height], axis=-1)

    def after(self, actions: Float[Array, "B A"], tool: Float[Array, "B 8"]) -> Float[Array, "B 8"]:
        """The tool's pose, unchanged: it does not matter to the next push."""
        del actions
        return tool

    def motion(self, action: Float32[np.ndarray, " A"], tool: ToolPose, site: Site) -> Motion:
        """Motion from above the start down to the push height, along the push, and up; within the site's speed."""
        del tool
        flat = np.cumsum(np.asarray(action, np.float64).reshape(-1, 2), axis=0)
        push = np.concatenate([flat, np.full((len(flat), 1), self.height_m)], axis=1)
        above = np.array([0.0, 0.0, site.travel_height_m - self.height_m])
        speeds = np.full(len(push) + 2, self.speed_m_s)
        speeds[[0, 1, -1]] = self.approach_m_s
        positions = np.concatenate([push[:1] + above, push, push[-1:] + above])
        return Motion(positions=positions, speeds=np.minimum(speeds, site.limits.speed_m_s))

    def measured_path(self, tool: Float[np.ndarray, "M K"]) -> Float32[np.ndarray, "T 3"]:
        """The part of the way near push height, or near its lowest point above that, resampled to equal steps.

        Raises ValueError where nothing was measured.
        """
        return (self._interpolation() @ self._measured_waypoints(tool)).astype(np.float32)

    def measured_action(self, tool: Float[np.ndarray, "M K"]) -> Float32[np.ndarray, " A"]:
        """The action from the beginning of that part, in displacements of equal length. Raises as `measured_path`."""
        points = self._measured_waypoints(tool)[:, :2]
        return np.concatenate([points[0], np.diff(points, axis=0).ravel()]).astype(np.float32)

    def _measured_waypoints(self, tool: Float[np.ndarray, "M K"]) -> Float64[np.ndarray, "W 3"]:
        if not len(tool):
            raise ValueError("No tool positions were measured; the transition cannot be simulated.")
        positions = tool[:, :3]
        heights = positions[:, 2]
        path = positions[heights < max(self.height_m, float(heights.min())) + LOW_ENOUGH_M]
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1))])
        nodes = np.linspace(0.0, arc[-1], self.displacements + 1)
        return np.stack([np.interp(nodes, arc, path[:, k]) for k in range(3)], axis=1)

    def _split(self, actions: Float[Array, "B A"]) -> tuple[Float[Array, "B 2"], Float[Array, "B D 2"]]:
        return actions[:, :2], actions[:, 2:].reshape(-1, self.displacements, 2)

    def _join(self, start: Float[Array, "B 2"], steps: Float[Array, "B D 2"]) -> Float[Array, "B A"]:
        return jnp.concatenate([start, steps.reshape(start.shape[0], -1)], axis=-1)

    def _waypoints(self, actions: Float[Array, "B A"]) -> Float[Array, "B W 2"]:
        return jnp.cumsum(actions.reshape(len(actions), -1, 2), axis=1)

    def _interpolation(self) -> Float32[np.ndarray, "T W"]:
        """Maps waypoints to tool positions: row s holds the two weights of substep s.

        The speed along the push rises and falls like sin^2, without a jerk that would throw the object.
        """
        time = np.minimum(np.arange(self.substeps + 1) / self.push_substeps, 1.0)
        at = (time - np.sin(2 * np.pi * time) / (2 * np.pi)) * self.displacements
        return np.maximum(0.0, 1.0 - np.abs(at[:, None] - np.arange(self.displacements + 1))).astype(np.float32)

    def _clear(self, start: Float[Array, "B 2"], x: Float[Array, "B N 2"]) -> Float[Array, "B 2"]:
        low, high = self._bounds()

        def step(_: Int[Array, ""], start: Float[Array, "B 2"]) -> Float[Array, "B 2"]:
            to_middle = start[:, None] - x
            away = from_core(to_middle, self.core_m)
            nearest = jnp.argmin(_length(away), axis=-1)[:, None, None]
            to_middle, away = (jnp.take_along_axis(each, nearest, axis=1)[:, 0] for each in (to_middle, away))
            missing = jnp.maximum(0.0, self.clearance_m - _length(away))
            if self.core_m != (0.0, 0.0):
                # A core that lies across a rope comes free endways, not sideways.
                away = away + (missing / self.clearance_m)[:, None] * to_middle
            return self._outside(jnp.clip(start + (missing / _length(away))[:, None] * away, low, high))

        return jax.lax.fori_loop(0, _CLEARING_STEPS, step, start)

    def _slid(self, start: Float[Array, "B 2"], steps: Float[Array, "B D 2"]) -> Float[Array, "B D 2"]:
        """Positions after successive displacements, kept within the region and outside of the keep-out rectangles.

        A displacement is shorter than half of any rectangle, so that none is stepped over.
        """
        low, high = self._bounds()

        def step(at: Float[Array, "B 2"], by: Float[Array, "B 2"]) -> tuple[Float[Array, "B 2"], Float[Array, "B 2"]]:
            there = self._outside(jnp.clip(at + by, low, high))
            return there, there

        return jnp.swapaxes(jax.lax.scan(step, start, jnp.swapaxes(steps, 0, 1))[1], 0, 1)

    def _outside(self, points: Float[Array, "*axes 2"]) -> Float[Array, "*axes 2"]:
        """The points, those in a rectangle moved to the nearest of its sides."""
        for x_low, y_low, x_high, y_high in self.keep_out:
            x, y = points[..., 0], points[..., 1]
            ways = jnp.stack([x_low - x, x_high - x, y_low - y, y_high - y], axis=-1)
            within = (ways[..., 0] < 0) & (ways[..., 1] > 0) & (ways[..., 2] < 0) & (ways[..., 3] > 0)
            side = jnp.argmin(jnp.abs(ways), axis=-1)
            by = jnp.where(within, jnp.take_along_axis(ways, side[..., None], axis=-1)[..., 0], 0.0)
            points = points + jnp.stack([jnp.where(side < 2, by, 0.0), jnp.where(side < 2, 0.0, by)], axis=-1)
        return points

    def _bounds(self) -> tuple[Float32[np.ndarray, "2"], Float32[np.ndarray, "2"]]:
        return np.asarray(self.region[:2], np.float32), np.asarray(self.region[2:], np.float32)


def _frame(way: Float[Array, "B 2"]) -> Float[Array, "B 2 2"]:
    """Columns along a way and across it, over its squared length, and no less than a square millimetre."""
    along = way / jnp.maximum((way**2).sum(-1, keepdims=True), 1e-6)
    return jnp.stack([along, jnp.stack([-along[:, 1], along[:, 0]], axis=-1)], axis=-1)


def _length(vectors: Float[Array, "*axes 2"]) -> Float[Array, "*axes"]:
    """Euclidean length [m] that is never zero, with a finite gradient everywhere."""
    return jnp.sqrt((vectors**2).sum(-1) + 1e-12)
