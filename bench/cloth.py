"""Two ways to simulate cloth, hanging over a rod: `python -m bench.cloth` prints what decision 5 compares.

Codimensional material points (the threads' deformation is carried by particles) and a mesh of springs whose forces are
added to the particles' momenta. The first are the product's kernels, on three grids; the second is plain JAX on the
finest one's cells, with contact that moves particles out of the rod, so that of its times only that of its forces says
something.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from rich.console import Console
from rich.table import Table

from app.core.errors import ParameterError
from app.sim.materials.cloth import ClothMaterial
from app.sim.model.scene import Body, Scene
from app.sim.runtime.rollout import make_rollout
from app.sim.state import State
from app.sim.tools.rod import RodCollider

ROWS = 32
SIDE_M, THICK_M, AREAL_KG_M2 = 0.30, 0.001, 0.2
SPACING_M = SIDE_M / ROWS
ROD_M, ROD_HEIGHT_M = 0.010, 0.20
STIFFNESS_PA, FRICTION, SECONDS = 2e4, 0.5, 1.2
CLOTH = ClothMaterial()
SCENE = Scene(
    low=(-0.20, -0.20, -0.025),
    high=(0.20, 0.20, 0.275),
    cell_m=0.0125,
    dt_s=3e-4,
    damping_1_s=1.0,
    contact_margin_m=0.002,
    contact_width_m=1e-3,
    bodies=(Body(volume_m3=SIDE_M**2 * THICK_M, density_kg_m3=AREAL_KG_M2 / THICK_M, material=CLOTH),),
    tools=(RodCollider(half_length_m=0.18, radius_m=ROD_M, place_m=(0.0, 0.0, ROD_HEIGHT_M), friction=FRICTION),),
)
"""32 x 32 particles, 9.4 mm apart, on cells of 12.5 mm; a rod along y under the cloth's middle."""


def start() -> State:
    """Flat, just above the rod."""
    axis = SPACING_M * (np.arange(ROWS) + 0.5) - SIDE_M / 2
    x, y = np.meshgrid(axis, axis, indexing="ij")
    z = np.full_like(x, ROD_HEIGHT_M + ROD_M + 0.003)
    return State.at_rest(jnp.asarray(np.stack([x, y, z], axis=-1).reshape(1, -1, 3), jnp.float32))


def mesh(state: State) -> jax.Array:
    """Springs along threads and diagonals: the same membrane's stiffness and share of compression."""
    x = state.x[0].reshape(ROWS, ROWS, 3)
    force = jnp.zeros_like(x)
    membrane = STIFFNESS_PA * THICK_M
    for i, j, stiffness in ((1, 0, 1.0), (0, 1, 1.0), (1, 1, CLOTH.shear / 4), (1, -1, CLOTH.shear / 4)):
        a = x[: ROWS - i, max(0, -j) : ROWS - max(0, j)]
        b = x[i:, max(0, j) : ROWS + min(0, j)]
        rest = SPACING_M * (i * i + j * j) ** 0.5
        length = jnp.linalg.norm(b - a, axis=-1, keepdims=True)
        stretch = length - rest
        pull = membrane * stiffness * jnp.maximum(stretch, CLOTH.buckling * stretch) * (b - a) / length
        force = force.at[: ROWS - i, max(0, -j) : ROWS - max(0, j)].add(pull)
        force = force.at[i:, max(0, j) : ROWS + min(0, j)].add(-pull)
    return force.reshape(-1, 3)


_OFFSETS = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(27, 3)


def substep(dt: float, state: State) -> State:
    """MLS-MPM (Hu et al. 2018) with a rod that particles are moved out of, with Coulomb friction."""
    cell, (_, ny, nz) = SCENE.cell_m, SCENE.shape
    mass = AREAL_KG_M2 * SIDE_M**2 / ROWS**2
    x, v, C = state.x[0], state.v[0] + dt / mass * mesh(state), state.C[0]
    q = (x - jnp.asarray(SCENE.low)) / cell
    base = jnp.floor(q - 0.5).astype(int)
    f = q - base
    one = jnp.stack([0.5 * (1.5 - f) ** 2, 0.75 - (f - 1) ** 2, 0.5 * (f - 0.5) ** 2], axis=1)
    w = jnp.prod(jnp.take_along_axis(one, jnp.asarray(_OFFSETS)[None], axis=1), axis=-1)
    offset = cell * (_OFFSETS[None] - f[:, None])
    nodes = base[:, None] + _OFFSETS[None]
    flat = (nodes[..., 0] * ny + nodes[..., 1]) * nz + nodes[..., 2]
    momentum = w[..., None] * mass * (v[:, None] + jnp.einsum("nij,nkj->nki", C, offset))
    given = jnp.concatenate([momentum, mass * w[..., None]], axis=-1)
    grid = jnp.zeros((int(np.prod(SCENE.shape)), 4)).at[flat].add(given)
    u = (1 - dt * SCENE.damping_1_s) * grid[:, :3] / jnp.maximum(grid[:, 3:], 1e-12)
    u = (u - jnp.array([0.0, 0.0, dt * SCENE.gravity_m_s2]))[flat]
    v = jnp.einsum("nk,nki->ni", w, u)
    spin = 4 / cell**2 * jnp.einsum("nk,nki,nkj->nij", w, u, offset)
    x, v = outside(x + dt * v, v)
    return State(x=x[None], v=v[None], C=spin[None], F=state.F)


def outside(x: jax.Array, v: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Positions and velocities of particles that a rod along y does not let in."""
    away = (x - jnp.array([0.0, 0.0, ROD_HEIGHT_M])) * jnp.array([1.0, 0.0, 1.0])
    distance = jnp.linalg.norm(away, axis=-1, keepdims=True)
    n, gap = away / distance, distance - ROD_M - SCENE.contact_margin_m
    push = jnp.maximum(0.0, -(v * n).sum(-1, keepdims=True))
    tangential = v - (v * n).sum(-1, keepdims=True) * n
    speed = jnp.sqrt((tangential**2).sum(-1, keepdims=True) + 1e-6)
    slowed = v + push * n - jnp.minimum(1.0, FRICTION * push / speed) * tangential
    return jnp.where(gap < 0, x - gap * n, x), jnp.where(gap < 0, slowed, v)


class Hung(NamedTuple):
    """Final state of the cloth, and the cost of simulating it."""

    stretch_percent: float
    """Mean stretch of the threads across the rod."""
    worst: float
    """The longest distance of two neighbours, in spacings."""
    sides_m: tuple[float, float]
    """Length that hangs down on each side of the rod's axis."""
    fallen: bool
    ms: float
    """A substep's wall time."""


def judged(state: State, ms: float) -> Hung:
    """Numbers of a state."""
    x = np.asarray(state.x[0], np.float64).reshape(ROWS, ROWS, 3)
    threads = np.linalg.norm(np.diff(x, axis=0), axis=-1) / SPACING_M
    across = np.linalg.norm(np.diff(x, axis=1), axis=-1) / SPACING_M
    sides = tuple(float(ROD_HEIGHT_M - x[half, :, 2].min()) for half in (slice(0, 16), slice(16, 32)))
    return Hung(
        stretch_percent=100 * (float(threads.mean()) - 1),
        worst=float(max(threads.max(), across.max())),
        sides_m=(sides[0], sides[1]),
        fallen=bool(x[15:17, :, 2].max() < ROD_HEIGHT_M) or not np.isfinite(x).all(),
        ms=ms,
    )


def in_jax(dt: float) -> Hung:
    """Hang the mesh."""
    steps = round(SECONDS / dt)

    def one(_: int, now: State) -> State:
        return substep(dt, now)

    @jax.jit
    def run(state: State) -> State:
        return jax.lax.fori_loop(0, steps, one, state)

    run(start())
    begin = time.perf_counter()
    end = jax.block_until_ready(run(start()))
    return judged(end, 1e3 * (time.perf_counter() - begin) / steps)


def in_product(cell_m: float, dt: float) -> Hung:
    """Hang it by the product's kernels."""
    scene = replace(SCENE, dt_s=dt, cell_m=cell_m, low=(-0.2, -0.2, -2 * cell_m))
    steps = round(SECONDS / dt)
    simulate = make_rollout(scene, particle_count=ROWS**2, effects=())
    arguments = (jnp.float32([[STIFFNESS_PA, 0.4]]), start(), jnp.zeros((1, steps + 1, 0)))
    simulate(*arguments)
    begin = time.perf_counter()
    end = jax.block_until_ready(simulate(*arguments))
    return judged(end, 1e3 * (time.perf_counter() - begin) / steps)


def stable_dt(hang: Callable[[float], Hung]) -> float:
    """The largest of these steps with which it neither flies apart nor falls."""
    best = 0.0
    for dt in (2e-4, 3e-4, 4e-4, 6e-4, 8e-4):
        try:
            hung = hang(dt)
        except ParameterError:  # Beyond the scene's own limit.
            break
        if np.isfinite(hung.worst) and hung.worst < 1.5 and not hung.fallen:
            best = dt
    return best


def main() -> None:
    """Print a row a way, and the expected stretch: half of that at the rod."""
    table = Table("way", "stretch %", "worst gap", "sides mm", "fallen", "stable dt ms", "ms a substep")
    ways: dict[str, Callable[[float], Hung]] = {
        **{f"points, cells of {1e3 * cell:g} mm": partial(in_product, cell) for cell in (0.0125, 0.01875, 0.025)},
        "mesh, cells of 12.5 mm": in_jax,
    }
    for name, hang in ways.items():
        hung = hang(SCENE.dt_s)
        sides = " ".join(f"{1e3 * side:.0f}" for side in hung.sides_m)
        table.add_row(
            name,
            f"{hung.stretch_percent:.2f}",
            f"{hung.worst:.2f}",
            sides,
            "yes" if hung.fallen else "no",
            f"{1e3 * stable_dt(hang):.1f}",
            f"{hung.ms:.2f}",
        )
    expected = AREAL_KG_M2 * SCENE.gravity_m_s2 * SIDE_M / 2 / (STIFFNESS_PA * THICK_M) / 2
    forces = jax.jit(mesh)
    start_state = start()
    forces(start_state)
    begin = time.perf_counter()
    for _ in range(200):
        forces(start_state).block_until_ready()
    spent = 1e3 * (time.perf_counter() - begin) / 200
    table.caption = f"Expected stretch {100 * expected:.2f} %; the mesh's forces alone take {spent:.3f} ms."
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
