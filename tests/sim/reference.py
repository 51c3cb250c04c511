"""The oracle: the substep of `app.sim` once more, in plain JAX on a dense grid, in whatever precision its inputs have.

Written from the equations of the docstrings in `app/sim/physics.py`, sharing no code with the kernels. One candidate;
`jax.vmap` makes it many.
"""

from functools import partial

import jax
import jax.numpy as jnp

from app.sim.model.scene import Scene
from app.sim.state import State

PARAMETERS = ("stiffness", "table_friction", "finger_friction", "film_drag")
"""The columns of its phi."""

_OFFSETS = jnp.stack(jnp.meshgrid(*[jnp.arange(3)] * 3, indexing="ij"), axis=-1).reshape(27, 3)
_LEAST_SHARE = 1e-8  # of a particle's mass, that a node must hold to move
_LEAST_TOUCH = 1e-6


def spline(f):
    """Weights (N, 27) and offsets from the particle in cells (N, 27, 3)."""
    one = jnp.stack([0.5 * (1.5 - f) ** 2, 0.75 - (f - 1) ** 2, 0.5 * (f - 0.5) ** 2], axis=1)
    weights = jnp.prod(jnp.take_along_axis(one, _OFFSETS[None], axis=1), axis=-1)
    return weights, _OFFSETS[None] - f[:, None]


def coulomb(tangential, impulse, friction, slip):
    speed = jnp.sqrt((tangential**2).sum(-1, keepdims=True) + slip**2)
    return jnp.maximum(0.0, 1.0 - friction * impulse[..., None] / speed) * tangential


def touch(scene: Scene, x, tip, tip_velocity, mass):
    away = x[:, :2] - tip[:2]
    distance = jnp.sqrt((away**2).sum(-1) + 1e-12)
    tool = scene.tools[0]
    gap = distance - tool.radius_m - scene.contact_margin_m
    height = x[:, 2] - tip[2] + tool.below_m
    share = jax.nn.sigmoid(-gap / scene.contact_width_m) * jax.nn.sigmoid(height / tool.fade_m)
    share = jnp.where(share > _LEAST_TOUCH, share, 0.0)
    escape = jnp.clip(-gap / (scene.contact_substeps * scene.dt_s), 0.0, scene.escape_speed_m_s)
    normal = jnp.stack([away[:, 0] / distance, away[:, 1] / distance, jnp.zeros_like(gap)], axis=1)
    columns = [normal, jnp.ones_like(gap)[:, None], tip_velocity + escape[:, None] * normal]
    return mass * share[:, None] * jnp.concatenate(columns, axis=1)


def finger(scene: Scene, v, mass, touched, friction):
    touching = touched[:, 3] > 0
    n = jnp.where(touching[:, None], touched[:, :3], jnp.array([1.0, 0.0, 0.0]))
    n = n / jnp.linalg.norm(n, axis=1, keepdims=True)
    contact_mass = jnp.where(touching, touched[:, 3], 1.0)
    target = touched[:, 4:] / contact_mass[:, None]
    share = 1 - (1 - jnp.minimum(1.0, contact_mass / mass)) ** 4
    relative = v - target
    approach = (relative * n).sum(1)
    push = share * jnp.maximum(0.0, -approach)
    slid = coulomb(relative - approach[:, None] * n, push, friction, scene.slip_speed_m_s)
    return jnp.where(touching[:, None], target + (approach + push)[:, None] * n + slid, v)


def table(scene: Scene, v, height, friction):
    sinking = jnp.maximum(0.0, -v[:, 2])
    slid = coulomb(v * jnp.array([1.0, 1.0, 0.0]), sinking, friction, scene.slip_speed_m_s)
    stopped = slid.at[:, 2].set(v[:, 2] + sinking)
    return jnp.where((height < 0.5 * scene.cell_m)[:, None], stopped, v)


def substep(scene: Scene, phi, state: State, tips) -> State:
    """One substep of one candidate; `tips (2, 3)` at its beginning and end."""
    x, v, C, F = state
    count, (nx, ny, nz) = x.shape[0], scene.shape
    dt, cell = scene.dt_s, scene.cell_m
    body = scene.bodies[0]
    volume = body.volume_m3 / count
    mass = body.density_kg_m3 * volume
    E, nu = phi[0], body.material.poisson
    mu, lam = E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu))

    F = F + dt * C @ F
    identity = jnp.eye(3, dtype=F.dtype)
    J = jnp.linalg.det(F)[:, None, None]
    tau = mu * (F @ jnp.swapaxes(F, 1, 2) - identity) + lam * jnp.log(J) * identity
    affine = -4 * dt / cell**2 * volume * tau + mass * C

    q = (x - jnp.asarray(scene.low, x.dtype)) / cell
    base = jnp.floor(q - 0.5).astype(int)
    weights, offsets = spline(q - base)
    nodes = base[:, None] + _OFFSETS[None]
    flat = (nodes[..., 0] * ny + nodes[..., 1]) * nz + nodes[..., 2]
    momentum = weights[..., None] * (mass * v[:, None] + cell * jnp.einsum("nij,nkj->nki", affine, offsets))
    tip_velocity = (tips[1] - tips[0]) / dt
    touched = weights[..., None] * touch(scene, x, tips[0], tip_velocity, mass)[:, None]
    given = jnp.concatenate([momentum, mass * weights[..., None], touched], axis=-1)
    grid = jnp.zeros((nx * ny * nz, 11), x.dtype).at[flat].add(given)

    occupied = grid[:, 3] > _LEAST_SHARE * mass
    node_mass = jnp.where(occupied, grid[:, 3], 1.0)
    height = scene.low[2] + cell * (jnp.arange(nx * ny * nz) % nz)
    u = (1 - scene.damping_1_s * dt) * grid[:, :3] / node_mass[:, None]
    u = u - jnp.array([0.0, 0.0, scene.gravity_m_s2 * dt], x.dtype)
    u = jnp.exp(-phi[3] * dt * jnp.clip(1 - height / 0.02, 0, 1))[:, None] * u
    u = table(scene, u, height, phi[1])
    u = finger(scene, u, node_mass, grid[:, 4:], phi[2])
    u = jnp.where(occupied[:, None], u, 0.0)[flat]

    v = jnp.einsum("nk,nki->ni", weights, u)
    C = 4 / cell * jnp.einsum("nk,nki,nkj->nij", weights, u, offsets)
    return State(x=x + dt * v, v=v, C=C, F=F)


@partial(jax.jit, static_argnums=0)
def simulate(scene: Scene, phi, state: State, tool) -> State:
    """All substeps of all candidates; shapes as in `app.sim.runtime.rollout`."""

    def one(phi, state: State, tool) -> State:
        pairs = jnp.stack([tool[:-1], tool[1:]], axis=1)
        return jax.lax.scan(lambda now, tips: (substep(scene, phi, now, tips), None), state, pairs)[0]

    with jax.default_matmul_precision("highest"):
        return jax.vmap(one)(phi, state, tool)
