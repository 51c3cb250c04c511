"""How true and fast ropes as rods are: `python -m bench.rods`.

Random pushes of the simulated world's rope, seen exactly, in two sets; the rod's frictions and contact are fitted
to one set and tried on the other. Errors are mean distances of nodes. Then the time of a push on one core.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64
from rich.console import Console
from rich.table import Table
from scipy.optimize import least_squares

from app.policy.strokes import Plan
from app.rig.simulated.physics import WorldPhysics
from app.rig.simulated.rehearsal import rehearse
from app.sim.rods.rollout import RodPhysics, make_rod_rollout
from app.sim.rods.scene import RodScene
from app.sim.rods.state import RodState
from app.tasks import load

TASK: Final = load("rope_push")
SCENE: Final = RodScene(length_m=0.40, radius_m=0.008, mass_kg=0.064, finger_radius_m=0.009)
SIMULATE: Final = jax.jit(make_rod_rollout(SCENE))
PLAN: Final = Plan(episodes=10, pushes=6)
SEEDS: Final = (0, 77)
FITTED: Final = {"table_friction": 0.05, "finger_friction": 0.05, "climb": 0.2, "press": 0.2, "margin": 5e-4}
"""And how much of each is little."""
_SOFT_M, _LIFTED_M, _REST_S, _MIDDLE = 0.003, 0.05, 0.3, 10.0


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Pushes:
    """Nodes (P, 2, n) before and after, and paths (P, T, 3) of the finger, a time step apart."""

    before: Float64[np.ndarray, "P 2 n"]
    after: Float64[np.ndarray, "P 2 n"]
    tool: Float64[np.ndarray, "P T 3"]


def pushes(seed: int) -> Pushes:
    """Random ones of the nominal world."""
    takes = list(rehearse(TASK, PLAN, WorldPhysics(), (), seed))
    paths = [_down(take.command.times_s, take.command.poses[:, :3]) for take in takes]
    longest = max(map(len, paths)) + round(_REST_S / SCENE.dt_s)
    return Pushes(
        before=np.stack([take.before.snapshot.nodes[:, :2].T for take in takes]),
        after=np.stack([take.after.snapshot.nodes[:, :2].T for take in takes]),
        tool=np.stack([_lifted(path, longest) for path in paths]),
    )


def _down(times_s: np.ndarray, places: np.ndarray) -> np.ndarray:
    """The part of a path in which the finger is low, a time step apart."""
    at = np.arange(times_s[0], times_s[-1], SCENE.dt_s)
    path = np.stack([np.interp(at, times_s, places[:, axis]) for axis in range(3)], axis=1)
    return path[path[:, 2] < _LIFTED_M]


def _lifted(path: np.ndarray, length: int) -> np.ndarray:
    """With rest at its end, the finger up."""
    rest = np.tile(path[-1] + [0.0, 0.0, 1.0], (length - len(path), 1))
    return np.concatenate([path, rest])


def physics(values: dict[str, float], count: int) -> RodPhysics:
    """The nominal one but for these, for so many candidates."""
    given = {name: jnp.full(count, value, jnp.float32) for name, value in values.items()}
    return RodPhysics.nominal(SCENE, count)._replace(**given)


def errors_mm(of: Pushes, values: dict[str, float]) -> Float64[np.ndarray, " P"]:
    """Mean distance of nodes of each push."""
    end = SIMULATE(
        physics(values, len(of.before)), RodState.along(jnp.asarray(of.before)), jnp.asarray(of.tool, jnp.float32)
    )
    return 1e3 * np.linalg.norm(np.asarray(end.nodes[:, :2]) - of.after, axis=1).mean(1)


def fitted(to: Pushes) -> dict[str, float]:
    """Frictions and contact that fit these pushes, of which those far off count less."""
    nominal = SCENE.nominal_physics() | {"climb": 0.4, "press": 0.6}
    scales = np.array(list(FITTED.values()))
    start = np.array([nominal[name] for name in FITTED])

    def values(x: np.ndarray) -> dict[str, float]:
        return dict(zip(FITTED, (start + (x - _MIDDLE) * scales).tolist(), strict=True))

    def residuals(x: np.ndarray) -> np.ndarray:
        return errors_mm(to, values(x)) / (1e3 * _SOFT_M)

    middle = np.full(len(scales), _MIDDLE)  # Steps of differences are shares of it.
    return values(least_squares(residuals, middle, loss="cauchy", diff_step=0.2 / _MIDDLE, max_nfev=15).x)


def accuracy() -> Iterator[tuple[str, ...]]:
    """Rows of what was fitted, and errors on the other set."""
    sets = [pushes(seed) for seed in SEEDS]
    for fit, test in ((0, 1), (1, 0)):
        values = fitted(sets[fit])
        still = 1e3 * np.linalg.norm(sets[test].before - sets[test].after, axis=1).mean(1)
        errors = errors_mm(sets[test], values)
        told = ", ".join(f"{name} {value:.3g}" for name, value in values.items())
        summary = [f"{np.median(e):.2f} / {e.mean():.2f} / {np.percentile(e, 90):.2f}" for e in (still, errors)]
        yield f"fitted to {SEEDS[fit]}: {told}", str(len(errors)), *summary


def timed(count: int) -> tuple[str, ...]:
    """Milliseconds of processors a push of 1.4 s, and with its gradient."""
    one = pushes(SEEDS[0])
    which = np.arange(count) % len(one.before)
    tool = jnp.asarray(one.tool[which, :1401], jnp.float32)
    given, state = physics({}, count), RodState.along(jnp.asarray(one.before[which]))

    def cost(path: jax.Array) -> jax.Array:
        return jnp.square(SIMULATE(given, state, path).nodes[:, :2]).sum()

    works = [jax.jit(cost), jax.jit(jax.grad(cost))]
    taken = list[float]()
    for work in works:
        jax.block_until_ready(work(tool))
        began_s = time.process_time()
        for _ in range(3):
            jax.block_until_ready(work(tool))
        taken.append(1e3 * (time.process_time() - began_s) / 3 / count)
    return str(count), f"{taken[0]:.2f}", f"{taken[1]:.2f}"


def main() -> None:
    """Print the tables."""
    console = Console(width=140)
    table = Table("", "pushes", "no motion: median / mean / 90 %, mm", "rod")
    for row in accuracy():
        table.add_row(*row)
    console.print(table)
    table = Table("candidates", "push, ms of a core", "with gradient")
    for count in (1, 16, 64, 256):
        table.add_row(*timed(count))
    console.print(table)


if __name__ == "__main__":
    main()
