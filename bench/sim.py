"""Speed of the simulation of ropes and of its gradient, and times of the paper's decisions.

The number that counts is particle-substeps a second: particles times candidates times substeps, over wall time. Every
case runs in a process of its own, so that its peak memory is its own; the plain-JAX reference of the tests runs in the
same process right after it. The first compilation is into empty caches; "again" is the first call of a second process.
"""

import json as json_format
import multiprocessing
import os
import resource
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar, final

import jax
import jax.numpy as jnp
import numpy as np
from rich.console import Console
from rich.table import Table

from app.sim.model.params import NOMINAL_PHYSICS, nominal_phi
from app.sim.model.scene import Body, Scene
from app.sim.runtime.rollout import Simulate, make_rollout
from app.sim.state import Setting, State
from app.tasks.elements.curves import fill_tube

_CASES = {"cpu": ((300, 16), (2000, 1)), "gpu": ((2000, 16), (300, 150), (2000, 1))}
_LENGTH_M, _RADIUS_M = 0.40, 0.008
_SPEED_M_S = 0.3
_SUBSTEPS = {"cpu": 200, "gpu": 400}
_REFERENCE_SUBSTEPS = 10
_BRANCHES = 256
SCENE = Scene(bodies=(Body(volume_m3=8.0e-5, density_kg_m3=800.0),))
ResultT = TypeVar("ResultT")


@final
@dataclass(frozen=True, kw_only=True)
class Row:
    """One case. Rates are particle-substeps a second; what was not measured is None."""

    case: str
    device: str
    particles: int
    candidates: int
    forward: float | None = None
    forward_backward: float | None = None
    compile_s: float | None = None
    compile_again_s: float | None = None
    peak_mib: float | None = None
    reference_forward: float | None = None
    reference_forward_backward: float | None = None
    seconds: float | None = None


def main(json: Path | None = None) -> None:
    """Print a row a case, and write the rows to a JSON file."""
    os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")  # Or this process would take the children's memory.
    console = Console()
    rows: list[Row] = []
    for case in (*_cases(), *_larger_cases()):
        console.print(f"measuring {case[0].__name__} {case[1:]}", highlight=False)
        rows += _apart(*case)
    for table in _tables(rows):
        console.print(table)
    if json is not None:
        json.write_text(json_format.dumps([asdict(row) for row in rows], indent=1), encoding="utf-8")
        console.print(f"{len(rows)} rows in {json}", highlight=False)


def _cases() -> list[tuple[Any, ...]]:
    return [(rates, particles, candidates) for particles, candidates in _CASES[_platform()]]


def _larger_cases() -> list[tuple[Any, ...]]:
    """The paper's decisions and the division among devices: on a CPU they would take most of an hour."""
    if _platform() == "cpu":
        return []
    return [(decided,), *([(divided,)] if len(jax.devices()) > 1 else [])]


def _platform() -> str:
    return "cpu" if jax.default_backend() == "cpu" else "gpu"


def _apart(measure: Callable[..., ResultT], *arguments: Any) -> ResultT:
    """Result of a measurement in a fresh process."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as process:
        return process.submit(measure, *arguments).result()


def rates(particles: int, candidates: int) -> list[Row]:
    """Forward, and forward with backward, of ropes that a finger pushes, every candidate at its own place."""
    substeps = _SUBSTEPS[_platform()]
    work = particles * candidates * substeps
    problem = pushes(particles, candidates, substeps)
    bare = make_rollout(SCENE, particle_count=particles, effects=())
    planned = (problem[0][:, : len(NOMINAL_PHYSICS)], *problem[1:])
    with tempfile.TemporaryDirectory() as empty:
        first, again = (_apart(compiled, particles, candidates, empty) for _ in range(2))
    before = _memory_mib()
    forward, both = (seconds(call, problem) for call in _calls(make_rollout(SCENE, particle_count=particles)))
    bare_forward, bare_both = (seconds(call, planned) for call in _calls(bare))
    peak = _memory_mib() - (before if _platform() == "cpu" else 0.0)
    reference = _reference(particles, candidates)
    return [
        Row(
            case=f"rope {particles} x {candidates}, no effects",
            device=jax.devices()[0].device_kind,
            particles=particles,
            candidates=candidates,
            forward=work / bare_forward,
            forward_backward=work / bare_both,
        ),
        Row(
            case=f"rope {particles} x {candidates}, all effects",
            device=jax.devices()[0].device_kind,
            particles=particles,
            candidates=candidates,
            forward=work / forward,
            forward_backward=work / both,
            compile_s=first,
            compile_again_s=again,
            peak_mib=peak,
            reference_forward=reference[0],
            reference_forward_backward=reference[1],
        ),
    ]


def compiled(particles: int, candidates: int, cache: str) -> float:
    """Seconds of the first call of a gradient, with Warp's and JAX's caches in a folder."""
    import warp as wp

    wp.config.kernel_cache_dir = os.path.join(cache, "warp")  # noqa: PTH118 - What Warp takes.
    jax.config.update("jax_compilation_cache_dir", os.path.join(cache, "jax"))  # noqa: PTH118
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    problem = pushes(particles, candidates, 20)
    jax.block_until_ready(problem)
    begin = time.perf_counter()
    _, gradient = _calls(make_rollout(SCENE, particle_count=particles))
    jax.block_until_ready(gradient(*problem))
    return time.perf_counter() - begin


def decided() -> list[Row]:
    """The paper's decisions."""
    from bench.decisions import decisions

    return [
        Row(
            case=f"{found.case}, {found.substeps} substeps",
            device=jax.devices()[0].device_kind,
            particles=found.particles,
            candidates=found.candidates,
            seconds=found.seconds,
        )
        for found in decisions()
    ]


def divided() -> list[Row]:
    """256 branches on one device, and on as many as there are, halving."""
    from app.sim.runtime.shard import mesh_of, over_devices, sharding

    substeps, rows = 100, []
    problem = pushes(2000, _BRANCHES, substeps)
    count = 1
    while count <= len(jax.devices()):
        mesh = mesh_of(jax.devices()[:count])
        simulate = over_devices(make_rollout(SCENE, particle_count=2000), mesh)
        placed = jax.device_put(problem, sharding(mesh))
        forward, both = (seconds(call, placed) for call in _calls(simulate))
        work = 2000 * _BRANCHES * substeps
        rows.append(
            Row(
                case=f"rope 2000 x {_BRANCHES} on {count} device(s)",
                device=jax.devices()[0].device_kind,
                particles=2000,
                candidates=_BRANCHES,
                forward=work / forward,
                forward_backward=work / both,
            )
        )
        count *= 2
    return rows


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


def seconds(call: Callable[..., Any], problem: tuple[Any, ...], repeats: int = 5) -> float:
    """The least of several calls after a first one, which compiles."""
    jax.block_until_ready(call(*problem))
    taken: list[float] = []
    for _ in range(repeats):
        begin = time.perf_counter()
        jax.block_until_ready(call(*problem))
        taken.append(time.perf_counter() - begin)
    return min(taken)


def _calls(simulate: Simulate) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """A rollout, and the gradient of a function of its end: the particles' squared y."""

    def value(phi: jax.Array, state: State, tool: jax.Array) -> jax.Array:
        return (simulate(phi, state, tool).x[..., 1] ** 2).mean()

    return jax.jit(simulate), jax.jit(jax.grad(value, argnums=(0, 1, 2)))


def _reference(particles: int, candidates: int) -> tuple[float, float]:
    """The rates of the plain-JAX oracle, whose substeps are too slow for many of them."""
    from tests.sim import reference

    def simulate(phi: jax.Array, state: State, tool: jax.Array, setting: Setting | None = None) -> State:
        del setting
        return reference.simulate(SCENE, phi[:, : len(reference.PARAMETERS)], state, tool)

    problem = pushes(particles, candidates, _REFERENCE_SUBSTEPS)
    work = particles * candidates * _REFERENCE_SUBSTEPS
    forward, both = (work / seconds(call, problem, repeats=2) for call in _calls(simulate))
    return forward, both


def _memory_mib() -> float:
    """The most that this process, or its device, has held so far."""
    stats = jax.devices()[0].memory_stats()
    if stats:
        return stats["peak_bytes_in_use"] / 2**20
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10


def _tables(rows: list[Row]) -> list[Table]:
    """Rates and, where decisions were timed, their times."""
    rated = Table("rope, effects", "fwd", "+ bwd", "compile", "again", "MiB", "JAX", "+ bwd")
    rated.title = f"{jax.devices()[0].device_kind}, JAX {jax.__version__}"
    rated.caption = "fwd, + bwd: million particle-substeps a second; JAX: the plain reference; MiB: peak memory"
    timed = Table("case", "particles", "candidates", "time", title="Decisions of ten gradient steps")
    for row in rows:
        if row.seconds is not None:
            timed.add_row(row.case, str(row.particles), str(row.candidates), f"{row.seconds:.2f} s")
            continue
        rates = [row.forward, row.forward_backward, row.reference_forward, row.reference_forward_backward]
        forward, both, reference, reference_both = ("" if rate is None else _millions(rate) for rate in rates)
        compile_s, again = ("" if taken is None else f"{taken:.1f} s" for taken in (row.compile_s, row.compile_again_s))
        peak = "" if row.peak_mib is None else f"{row.peak_mib:,.0f}"
        rated.add_row(
            row.case.removeprefix("rope ").removesuffix(" effects"),
            forward,
            both,
            compile_s,
            again,
            peak,
            reference,
            reference_both,
        )
    return [table for table in (rated, timed) if table.row_count]


def _millions(rate: float) -> str:
    """Three digits, without an exponent."""
    return f"{rate / 1e6:,.0f}" if rate >= 1e8 else f"{rate / 1e6:.3g}"


if __name__ == "__main__":
    main()
