"""Pour-Water as the paper's comparison has it (DaXBench): its start, goal, bowls, actions and metric, in our simulator.

What is recorded there has y up and the ground at y = 0.025 m, where its three lowest layers of nodes stop everything;
here z is up and the table at 0. Its bowls are shells about a middle radius, half the wall on either side.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

from app.core.errors import UsageError
from app.sim.materials.liquid import LiquidMaterial
from app.sim.model.scene import Body, Scene
from app.sim.runtime.rollout import Simulate, make_rollout
from app.sim.state import State
from app.sim.tools.bowl import BowlCollider

DATA = Path(__file__).parents[3] / "shared" / "data" / "daxbench"
STEPS, SUBSTEPS, PARTICLES, SEEDS = 100, 23, 702, 20
ACTION_UNITS = 500.0
"""Actions are divided by it: metres and radians a step."""
GROUND_M = 0.025
_HELD_M, _TARGET_M, _HALF_WALL_M = 0.09, 0.08, 0.008
_VOLUME_M3 = 0.07**3
TARGET_M = (0.5, -0.3, 0.06 - GROUND_M)
"""Centre of the target bowl's sphere."""
SCENE = Scene(
    low=(-0.6, -1.6, -0.025),
    high=(1.6, 0.9, 0.425),
    cell_m=1 / 80,
    dt_s=3e-4,
    gravity_m_s2=9.8,
    damping_1_s=0.0,
    # A few seeds begin with water in the wall of the held bowl: it is let out slowly.
    escape_speed_m_s=0.2,
    # Contact fades as exp(-666 d) there; particles are held off a wall by half of their spacing.
    contact_margin_m=0.5 * (_VOLUME_M3 / PARTICLES) ** (1 / 3),
    contact_width_m=0.0015,
    bodies=(Body(volume_m3=_VOLUME_M3, density_kg_m3=1000.0, material=LiquidMaterial(viscosity_pa_s=0.0, spray=3.0)),),
    tools=(
        BowlCollider(radius_m=_HELD_M - _HALF_WALL_M, thickness_m=2 * _HALF_WALL_M, friction=0.1),
        BowlCollider(
            radius_m=_TARGET_M - _HALF_WALL_M,
            thickness_m=2 * _HALF_WALL_M,
            friction=0.1,
            place_m=TARGET_M,
            motion="fixed",
        ),
    ),
)
PHI = np.array([1000.0, 0.1], np.float32)
"""Bulk modulus [Pa], which is lambda 1 at density 1 there (sound runs at 1 m/s), and friction on the ground."""


@final
@dataclass(frozen=True, kw_only=True)
class Problem:
    """Start and goal of the water, index by index, and where the held bowl is at first, a row a seed [m]."""

    water: Float32[np.ndarray, "N 3"]
    goal: Float32[np.ndarray, "N 3"]
    held: Float32[np.ndarray, "seeds 3"]


@final
class Outcome(NamedTuple):
    """Final state of B candidates; `over_rim_m`: see there."""

    reward: Float[Array, " B"]
    inside: Float[Array, " B"]
    chamfer_m2: Float[Array, " B"]
    over_rim_m: Float[Array, " B"]


def problem(folder: Path = DATA) -> Problem:
    """Problem recorded in `folder`. Raises UsageError if it is not there."""
    start, goal = folder / "pour_water_start.npz", folder / "pour_water_goal.npy"
    if not (start.is_file() and goal.is_file()):
        raise UsageError(f"There is no reference problem in {folder}; give the folder that holds {goal.name}.")
    with np.load(start) as arrays:
        water, held = arrays["water"], arrays["bowl_held"]
    return Problem(water=_upright(water), goal=_upright(np.load(goal)), held=_upright(held))


@cache
def simulate() -> Simulate:
    """The simulator of the reference's scene."""
    return make_rollout(SCENE, particle_count=PARTICLES, effects=())


def poses(actions: Float[Array, "B H 6"], held: Float[Array, "B 3"]) -> Float[Array, "B T 7"]:
    """The held bowl at the ends of all substeps, for actions of the reference: its axes, y translation left out."""
    moved = actions.at[..., 1].set(0.0) / ACTION_UNITS
    linear, turn = _axes(moved[..., :3]), _axes(moved[..., 3:])
    share = jnp.arange(1, SUBSTEPS + 1) / SUBSTEPS

    def turned(now: Float[Array, "B 4"], by: Float[Array, "B 3"]) -> tuple[Float[Array, "B 4"], Float[Array, "B S 4"]]:
        path = _product(_quaternion(share[:, None] * by[:, None]), now[:, None])
        path = path / jnp.sqrt((path**2).sum(-1, keepdims=True))
        return path[:, -1], path

    upright = jnp.broadcast_to(jnp.array([1.0, 0.0, 0.0, 0.0]), (len(held), 4))
    _, turns = jax.lax.scan(turned, upright, jnp.swapaxes(turn, 0, 1))
    ends = held[:, None] + jnp.cumsum(linear, axis=1)
    begins = ends - linear
    places = begins[:, :, None] + share[:, None] * linear[:, :, None]
    path = jnp.concatenate([places, jnp.moveaxis(turns, 0, 1)], axis=-1).reshape(len(held), -1, 7)
    return jnp.concatenate([jnp.concatenate([held, upright], axis=-1)[:, None], path], axis=1)


def poured(
    actions: Float[Array, "B H 6"], water: Float[Array, "N 3"], held: Float[Array, "B 3"]
) -> Float[Array, "B N 3"]:
    """Water after the actions; NaN if some of it left the grid."""
    count = len(actions)
    state = State.at_rest(jnp.broadcast_to(water, (count, *water.shape)))
    return simulate()(jnp.broadcast_to(PHI, (count, 2)), state, poses(actions, held)).x


def reward(x: Float[Array, "B N 3"], goal: Float[Array, "N 3"]) -> Float[Array, " B"]:
    """exp(-10 l2), l2 the mean over particles, paired by index, of the root mean square of their three errors."""
    return jnp.exp(-10.0 * jnp.sqrt(((x - goal) ** 2).mean(-1) + 1e-12).mean(-1))


def inside(x: Float[Array, "B N 3"]) -> Float[Array, " B"]:
    """The share of the particles that are within the target bowl's inner sphere, below its rim."""
    centre = jnp.array(TARGET_M)
    return ((((x - centre) ** 2).sum(-1) < (_TARGET_M - _HALF_WALL_M) ** 2) & (x[..., 2] < centre[2])).mean(-1)


def over_rim_m(
    x: Float[Array, "B N 3"], actions: Float[Array, "B H 6"], held: Float[Array, "B 3"]
) -> Float[Array, " B"]:
    """Height of the uppermost hundredth of the water over the plane of the held bowl's rim [m]; none leaves below."""
    pose = poses(actions, held)[:, -1]
    w, a = pose[:, 3:4], pose[:, 4:]
    up = jnp.array([0.0, 0.0, 1.0])
    normal = up + 2 * w * jnp.cross(a, up) + 2 * jnp.cross(a, jnp.cross(a, up))
    height = ((x - pose[:, None, :3]) * normal[:, None]).sum(-1)
    return jax.lax.top_k(height, max(1, x.shape[1] // 100))[0].mean(-1)


def best_while_held(problem: Problem, relative_volume: float = 1.0) -> float:
    """The most reward that water can have which has not left the held bowl, wherever that is, however it is turned.

    Its inside is part of a ball, whose centre keeps its height. In a ball, the centroid of a volume is lowest as a
    cap's; particles are on average at least that much too high, and a mean of distances is no less than this over
    sqrt 3, which the metric divides by.
    """
    radius = _HELD_M - _HALF_WALL_M
    fills = np.linspace(0.0, radius, 10001)
    caps = np.pi * fills**2 * (3 * radius - fills) / 3
    fill = float(np.interp(relative_volume * _VOLUME_M3, caps, fills))
    centroid = problem.held[0, 2] - 3 * (2 * radius - fill) ** 2 / (4 * (3 * radius - fill))
    return float(np.exp(-10.0 * (centroid - problem.goal[:, 2].mean()) / np.sqrt(3.0)))


def _upright(points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, "N 3"]:
    return np.stack([points[:, 0], -points[:, 2], points[:, 1] - GROUND_M], axis=1).astype(np.float32)


def _axes(vectors: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3"]:
    return jnp.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], axis=-1)


def _quaternion(turn: Float[Array, "*batch 3"]) -> Float[Array, "*batch 4"]:
    """Quaternion of a rotation vector [rad]."""
    angle = jnp.sqrt((turn**2).sum(-1, keepdims=True) + 1e-16)
    return jnp.concatenate([jnp.cos(angle / 2), jnp.sin(angle / 2) / angle * turn], axis=-1)


def _product(a: Float[Array, "*batch 4"], b: Float[Array, "*batch 4"]) -> Float[Array, "*batch 4"]:
    """Hamilton's: first `b`, then `a`."""
    scalar = a[..., :1] * b[..., :1] - (a[..., 1:] * b[..., 1:]).sum(-1, keepdims=True)
    vector = a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + jnp.cross(a[..., 1:], b[..., 1:])
    return jnp.concatenate([scalar, vector], axis=-1)
