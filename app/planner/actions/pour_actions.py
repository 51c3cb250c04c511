"""Actions of a held bowl: one velocity and rate of turning for a while, from where it is, and then a rest."""

from dataclasses import dataclass
from functools import partial
from typing import TypeAlias, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, Float64
from scipy.spatial.transform import Rotation

from app.config import Site
from app.core.motion import Motion
from app.core.types import Points, ToolPose
from app.planner.actions.actions import Reach
from app.policy.base import PlanningState
from app.policy.symmetry import Isometry

Corner: TypeAlias = tuple[float, float, float]
_LEVER_M = 0.1
"""An arm counts a turn as the way that a point so far from the tip makes with it."""
_WAYPOINTS = 9
_RAMP = 0.25
"""Share of a motion's time in which it gets up to its speed, and again in which it comes to rest: that of the longest
shift at the default site's acceleration. A tilt alone has 0.08, and takes the arm 0.54 s instead of 0.66."""
_STILL = 1e-16
"""Added to the square of an angle, which then has a derivative at 0."""
_EDGE_M, _EDGE_RAD = 1e-4, 1e-3


@final
@dataclass(frozen=True, kw_only=True)
class Pours:
    """Actions of 6 numbers: shift of the bowl [m], and rotation vector in the world's frame [rad].

    Both happen at once, at an even speed but for its beginning and end, in `move_substeps`; in `rest_substeps` the
    liquid comes to rest behind it. Water in a bowl of radius R swings by itself in about 2 pi sqrt(R / g), half a
    second, so that what spills hangs on how a motion begins and ends. The bowl's centre stays in the box `low` to
    `high` [m], whose floor is high enough for it to be over the other bowl however it is turned, and its axis within
    `max_tilt_rad` of upright. `move_s`: how long the real arm takes, which has no more than the site's speed.
    """

    low: Corner
    high: Corner
    max_shift_m: float
    max_turn_rad: float
    max_tilt_rad: float
    move_substeps: int
    rest_substeps: int
    move_s: float
    shift_scale_m: float = 0.01
    turn_scale_rad: float = 0.06
    size: int = 6

    @property
    def anywhere(self) -> bool:
        """An action begins where the tool is."""
        return False

    @property
    def divisible(self) -> bool:
        """A part of a shift and of a turn."""
        return True

    @property
    def chunk(self) -> tuple[int, int]:
        """The whole of it."""
        return 1, self.size

    @property
    def substeps(self) -> int:
        """Moving and resting."""
        return self.move_substeps + self.rest_substeps

    @property
    def reach(self) -> Reach:
        """Workspace of the bowl, and below."""
        (x0, y0, _), (x1, y1, z1) = self.low, self.high
        return (x0, y0, 0.0), (x1, y1, z1)

    def sample(self, rng: np.random.Generator, x: Points, tool: ToolPose, count: int) -> Float32[np.ndarray, "count A"]:
        """Evenly from the balls of shifts and turns that are allowed, and then projected."""
        balls = [_in_ball(rng, count, radius) for radius in (self.max_shift_m, self.max_turn_rad)]
        actions = jnp.asarray(np.concatenate(balls, axis=1), jnp.float32)
        now = PlanningState.at_rest(jnp.tile(jnp.asarray(x)[None, :1], (count, 1, 1)), tool)
        return np.array(_project(self, actions, now))

    def project(self, actions: Float[Array, "B A"], now: PlanningState) -> Float[Array, "B A"]:
        """Shift and turn no longer than allowed; of the turn as much as does not tilt too far; an end in the box."""
        shift, turn = _no_longer(actions[:, :3], self.max_shift_m), _no_longer(actions[:, 3:], self.max_turn_rad)
        place = now.tool[:, :3]
        shift = jnp.clip(place + shift, jnp.asarray(self.low), jnp.asarray(self.high)) - place
        before, after = tilt(now.tool[:, 3:7]), tilt(_turn(turn, now.tool[:, 3:7]))
        share = jnp.clip((self.max_tilt_rad - before) / jnp.maximum(after - before, _EDGE_RAD), 0.0, 1.0)
        share = jnp.where(after > self.max_tilt_rad, share, 1.0)
        return jnp.concatenate([shift, share[:, None] * turn], axis=1)

    def is_allowed(self, actions: Float[Array, "B A"], now: PlanningState) -> Bool[Array, " B"]:
        """True if it ends in the box."""
        end = now.tool[:, :3] + actions[:, :3]
        return jnp.all((end >= jnp.asarray(self.low) - _EDGE_M) & (end <= jnp.asarray(self.high) + _EDGE_M), axis=-1)

    def contains(self, places: Float64[np.ndarray, "W 3"]) -> bool:
        """True if all places [m] are in the box."""
        return bool(((places >= np.array(self.low) - _EDGE_M) & (places <= np.array(self.high) + _EDGE_M)).all())

    def scale(self) -> Float32[np.ndarray, " A"]:
        """A centimetre and a few degrees."""
        return np.repeat(np.array([self.shift_scale_m, self.turn_scale_rad], np.float32), 3)

    def transform(self, actions: Float[Array, "B A"], by: Isometry) -> Float[Array, "B A"]:
        """Shift and turn."""
        return jnp.concatenate([by.directions(actions[:, :3]), by.rotations(actions[:, 3:])], axis=1)

    def tool_path(self, actions: Float[Array, "B A"], tool: Float[Array, "B 8"]) -> Float[Array, "B T 7"]:
        """Place and turn from upright of the bowl."""
        share = jnp.asarray(self._shares())[None, :, None]
        places = tool[:, None, :3] + share * actions[:, None, :3]
        turns = _turn(share * actions[:, None, 3:], tool[:, None, 3:7])
        return jnp.concatenate([places, from_upright(turns)], axis=-1)

    def after(self, actions: Float[Array, "B A"], tool: Float[Array, "B 8"]) -> Float[Array, "B 8"]:
        """Shifted and turned."""
        return jnp.concatenate([tool[:, :3] + actions[:, :3], _turn(actions[:, 3:], tool[:, 3:7]), tool[:, 7:]], axis=1)

    def motion(self, action: Float32[np.ndarray, " A"], tool: ToolPose, site: Site) -> Motion:
        """Straight on from where the tool is, the first of its positions, at an even speed."""
        share = np.linspace(0.0, 1.0, _WAYPOINTS)[:, None]
        turns = np.asarray(_turn(jnp.asarray(share * action[3:]), jnp.asarray(tool[3:7])), np.float64)
        length = float(np.hypot(np.linalg.norm(action[:3]), _LEVER_M * np.linalg.norm(action[3:])))
        speed = min(max(length, _EDGE_M) / self.move_s, site.limits.speed_m_s)
        return Motion(
            positions=tool[:3] + share * action[:3].astype(np.float64),
            speeds=np.full(_WAYPOINTS, speed),
            turns=turns / np.linalg.norm(turns, axis=1, keepdims=True),
            continues=True,
        )

    def measured_path(self, tool: Float[np.ndarray, "M K"]) -> Float32[np.ndarray, "T 7"]:
        """The measured way in the simulated one's time. Raises ValueError where nothing, or no turn, was measured."""
        if not len(tool) or tool.shape[1] < 7:
            raise ValueError("No poses of the bowl were measured; the transition cannot be simulated.")
        flips = np.where((tool[1:, 3:7] * tool[:-1, 3:7]).sum(1) < 0, -1.0, 1.0)
        turns = tool[:, 3:7] * np.cumprod(np.append(1.0, flips))[:, None]
        way = np.concatenate([tool[:, :3], 2 * _LEVER_M * turns], axis=1)
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
        at = self._shares() * arc[-1]
        path = np.stack([np.interp(at, arc, column) for column in way.T], axis=1)
        turned = np.asarray(from_upright(jnp.asarray(path[:, 3:])))
        turned = turned / np.linalg.norm(turned, axis=1, keepdims=True)
        return np.concatenate([path[:, :3], turned], axis=1).astype(np.float32)

    def measured_action(self, tool: Float[np.ndarray, "M K"]) -> Float32[np.ndarray, " A"]:
        """Shift and rotation of the last pose from the first. Raises ValueError as `measured_path`."""
        if not len(tool) or tool.shape[1] < 7:
            raise ValueError("No poses of the bowl were measured; the transition cannot be simulated.")
        before, after = (Rotation.from_quat(tool[at, 3:7], scalar_first=True) for at in (0, -1))
        shift, turn = tool[-1, :3] - tool[0, :3], (after * before.inv()).as_rotvec()
        return np.concatenate([shift, turn]).astype(np.float32)

    def _shares(self) -> Float32[np.ndarray, " T"]:
        """Share of an action made by the end of each substep: its speed is a trapezoid."""
        time = np.minimum(np.arange(self.substeps + 1) / self.move_substeps, 1.0)
        first, last = np.minimum(time, _RAMP), np.maximum(time - (1 - _RAMP), 0.0)
        even = np.clip(time, _RAMP, 1 - _RAMP) - _RAMP
        ways = first**2 / (2 * _RAMP) + even + last - last**2 / (2 * _RAMP)
        return (ways / (1 - _RAMP)).astype(np.float32)


@partial(jax.jit, static_argnums=0)  # Outside of a program, each of its operations would be compiled apart.
def _project(space: Pours, actions: Float[Array, "B 6"], now: PlanningState) -> Float[Array, "B 6"]:
    return space.project(actions, now)


def tilt(turn: Float[Array, "*batch 4"]) -> Float[Array, "*batch"]:
    """The angle [rad] between up and the axis of a bowl on a tool that is turned so."""
    up = up_of(turn)
    return jnp.arctan2(jnp.sqrt((up[..., :2] ** 2).sum(-1) + _STILL), up[..., 2])


def up_of(turn: Float[Array, "*batch 4"]) -> Float[Array, "*batch 3"]:
    """The axis of the bowl."""
    w, x, y, z = jnp.moveaxis(from_upright(turn), -1, 0)
    return jnp.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x**2 + y**2)], axis=-1)


def from_upright(turn: Float[Array, "*batch 4"]) -> Float[Array, "*batch 4"]:
    """The tool's quaternion as one of its bowl: times the conjugate of that of a tool that points down."""
    w, x, y, z = jnp.moveaxis(turn, -1, 0)
    return jnp.stack([x, -w, -z, y], axis=-1)


@jax.jit
def _turn(by: Float[Array, "*#batch 3"], turn: Float[Array, "*#batch 4"]) -> Float[Array, "*both 4"]:
    """`turn`, and then the rotation vector `by` [rad] about the world's axes."""
    angle = jnp.sqrt((by**2).sum(-1, keepdims=True) + _STILL)
    w, v = jnp.cos(angle / 2), jnp.sin(angle / 2) / angle * by
    s, a = turn[..., :1], turn[..., 1:]
    scalar = w * s - (v * a).sum(-1, keepdims=True)
    return jnp.concatenate([scalar, w * a + s * v + jnp.cross(v, jnp.broadcast_to(a, v.shape))], axis=-1)


def _no_longer(vectors: Float[Array, "B 3"], most: float) -> Float[Array, "B 3"]:
    length = jnp.sqrt((vectors**2).sum(-1, keepdims=True) + _STILL)
    return vectors * jnp.minimum(1.0, most / length)


def _in_ball(rng: np.random.Generator, count: int, radius: float) -> Float64[np.ndarray, "count 3"]:
    """Evenly spread vectors no longer than `radius`."""
    direction = rng.standard_normal((count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return radius * np.cbrt(rng.random((count, 1))) * direction
