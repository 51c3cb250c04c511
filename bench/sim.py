"""How fast ropes are simulated and differentiated: `python -m bench.sim`.

The number that counts is particle-substeps a second: particles times candidates times substeps, over wall time. On a
CPU that others use as well, the same over the processor time of all threads says what a free core would do. The compile
time is that of a first ever call, into an empty cache.
"""

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import jax
import jax.numpy as jnp
import numpy as np
import warp as wp
from rich.console import Console
from rich.table import Table

from app.sim.params import nominal_phi
from app.sim.rollout import Simulate, make_rollout
from app.sim.scene import Body, Scene
from app.sim.state import State
from app.sim.warmup import warm_up
from app.tasks.curves import fill_tube

_CASES = ((300, 1), (300, 8), (300, 16), (2000, 1), (2000, 16))
_LENGTH_M, _RADIUS_M = 0.40, 0.008
_SPEED_M_S = 0.3
SCENE = Scene(bodies=(Body(volume_m3=8.0e-5, density_kg_m3=800.0),))


@final
@dataclass(frozen=True, kw_only=True)
class Rate:
    """Million particle-substeps a second, and a second of processor time; best of the repeats."""

    wall: float
    core: float


def main(substeps: int = 200, repeats: int = 5) -> None:
    """Print the compile time and a row a case."""
    console = Console()
    with tempfile.TemporaryDirectory() as empty:
        wp.config.kernel_cache_dir = empty
        begin = time.perf_counter()
        warm_up(console.print, SCENE)
        compile_s = time.perf_counter() - begin
    table = Table("particles", "candidates", "forward", "a core", "forward + backward", "a core")
    table.title = f"{jax.devices()[0].device_kind}, {substeps} substeps; first compilation {compile_s:.1f} s"
    table.caption = "Million particle-substeps a second, and a second of processor time"
    for particles, candidates in _CASES:
        rates = measured(particles, candidates, substeps, repeats)
        table.add_row(
            str(particles), str(candidates), *(f"{part:.2f}" for rate in rates for part in (rate.wall, rate.core))
        )
    console.print(table)


def measured(particles: int, candidates: int, substeps: int, repeats: int) -> tuple[Rate, Rate]:
    """Forward, and forward with backward, of ropes that a finger pushes, every candidate at its own place."""
    simulate = make_rollout(SCENE, particle_count=particles)
    problem = pushes(particles, candidates, substeps)
    calls = (jax.jit(simulate), jax.jit(jax.grad(distance(simulate), argnums=(0, 1, 2))))
    forward, both = (best(call, problem, particles * candidates * substeps * 1e-6, repeats) for call in calls)
    return forward, both


def pushes(particles: int, candidates: int, substeps: int) -> tuple[jax.Array, State, jax.Array]:
    """Parameters, ropes at rest along x, and tool paths along y."""
    middle = np.stack([np.linspace(-_LENGTH_M / 2, _LENGTH_M / 2, 81) + 0.5, np.zeros(81), np.full(81, _RADIUS_M)], 1)
    x = np.tile(fill_tube(middle, _RADIUS_M, particles), (candidates, 1, 1))
    tool = np.zeros((candidates, substeps + 1, 3), np.float32)
    tool[..., 0] = np.linspace(0.4, 0.6, candidates)[:, None]
    tool[..., 1] = -0.022 + _SPEED_M_S * SCENE.dt_s * np.arange(substeps + 1)
    tool[..., 2] = 0.006
    phi = np.tile(nominal_phi(), (candidates, 1))
    return jnp.asarray(phi), State.at_rest(jnp.asarray(x)), jnp.asarray(tool)


def distance(simulate: Simulate) -> Callable[..., jax.Array]:
    """Something to differentiate: how far the particles are along y, squared."""

    def value(phi: jax.Array, state: State, tool: jax.Array) -> jax.Array:
        return (simulate(phi, state, tool).x[..., 1] ** 2).mean()

    return value


def best(call: Callable[..., Any], problem: tuple[Any, ...], work: float, repeats: int) -> Rate:
    """Of several calls after a first one, which compiles."""
    jax.block_until_ready(call(*problem))
    walls: list[float] = []
    cores: list[float] = []
    for _ in range(repeats):
        begin, begin_core = time.perf_counter(), time.process_time()
        jax.block_until_ready(call(*problem))
        walls.append(time.perf_counter() - begin)
        cores.append(time.process_time() - begin_core)
    return Rate(wall=work / min(walls), core=work / min(cores))


if __name__ == "__main__":
    main()
