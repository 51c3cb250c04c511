"""Accuracy and speed of ropes as rods: `python -m bench.rods`, of one world of ropes `--world chain` or `cable`.

Random pushes of the rope in both simulated worlds, seen exactly, in two sets each. The rod's frictions and contact are
fitted to one set and tried on another, of the same world or of the other one; likewise its bending: its rigidity, and
the share of its bends that lasts. Errors are mean distances of nodes. Each world is also run against itself, from
starts displaced by a millimetre an axis: a lower bound on errors at that accuracy of observation. Then the time of a
push on one core.
"""

import argparse
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final, final, get_args

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float32, Float64
from rich.console import Console
from rich.table import Table
from scipy.optimize import least_squares

from app.core.geometry.scene_description import RopeModel
from app.discovery.residuals.centreline_noise import smooth_noise
from app.policy.random_pushes import PushDesign
from app.rig.simulated.push_session import PushSample, push_again
from app.rig.simulated.worlds.physics import ROPE_WORLDS
from app.rig.simulated.worlds.rope import resample
from app.sim.rods.rollout import RodPhysics, make_rod_rollout
from app.sim.rods.state import RodState
from app.tasks import load
from bench.photographs import rendered
from bench.rehearsal import rehearse

TASK: Final = load("rope_push")
assert TASK.rods is not None
SCENE: Final = TASK.rods.scene
SIMULATE: Final = jax.jit(make_rod_rollout(SCENE))
PLAN: Final = PushDesign(episodes=10, pushes=6)
SEEDS: Final = (0, 77)
FITTED: Final = {"table_friction": 0.05, "finger_friction": 0.05, "climb": 0.2, "press": 0.2, "margin": 5e-4}
"""Parameters that are fitted, and a small step of each."""
RIGIDITY: Final = {"rigidity": 0.2}
"""Rigidity, and its step as a share of it."""
SET: Final = {"permanent_set": 0.2}
"""Permanent set, between 0 and 1, and its step."""
_SET_STARTS: Final = (0.1, 0.9)
"""Whence it is fitted: a rope is mostly one or the other."""
BESIDE_M: Final = 1e-3
"""Standard deviation an axis of starts beside the true one."""
_TIMED_S, _SOFT_M, _LIFTED_M, _REST_S, _ASIDE = 1.4, 0.003, 0.05, 0.3, 0.2


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Pushes:
    """Nodes (P, 2, n) before and after, and paths (P, T, 3) of the finger, a time step apart."""

    before: Float64[np.ndarray, "P 2 n"]
    after: Float64[np.ndarray, "P 2 n"]
    tool: Float64[np.ndarray, "P T 3"]


@cache
def takes(world: RopeModel, seed: int) -> tuple[PushSample, ...]:
    """Random pushes of a nominal world."""
    return tuple(rehearse(TASK, PLAN, ROPE_WORLDS[world], (), seed))


@cache
def pushes(world: RopeModel, seed: int) -> Pushes:
    """The same as the rod sees them."""
    made = takes(world, seed)
    paths = [_down(take.command.times_s, take.command.poses[:, :3]) for take in made]
    longest = max(map(len, paths)) + round(_REST_S / SCENE.dt_s)
    return Pushes(
        before=np.stack([_level(take.before.snapshot.nodes) for take in made]),
        after=np.stack([_level(take.after.snapshot.nodes) for take in made]),
        tool=np.stack([_lifted(path, longest) for path in paths]),
    )


def _level(nodes: Float64[np.ndarray, "K 3"]) -> Float64[np.ndarray, "2 n"]:
    """Nodes, as many as the rod has, without their heights."""
    return (nodes if len(nodes) == SCENE.nodes else resample(nodes, SCENE.nodes))[:, :2].T


def _down(times_s: np.ndarray, places: np.ndarray) -> np.ndarray:
    """The part of a path in which the finger is low, a time step apart."""
    at = np.arange(times_s[0], times_s[-1], SCENE.dt_s)
    path = np.stack([np.interp(at, times_s, places[:, axis]) for axis in range(3)], axis=1)
    return path[path[:, 2] < _LIFTED_M]


def _lifted(path: np.ndarray, length: int) -> np.ndarray:
    """The path with rest at its end, the finger up."""
    rest = np.tile(path[-1] + [0.0, 0.0, 1.0], (length - len(path), 1))
    return np.concatenate([path, rest])


def physics(values: Mapping[str, float], count: int) -> RodPhysics:
    """The nominal one but for these, for so many candidates."""
    given = {name: jnp.full(count, value, jnp.float32) for name, value in values.items()}
    return RodPhysics.nominal(SCENE, count)._replace(**given)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Rod:
    """Values that are not nominal."""

    values: Mapping[str, float]

    def but(self, **values: float) -> "Rod":
        """The same with other values of these."""
        return Rod(values={**self.values, **values})

    def __str__(self) -> str:
        """Text of its values."""
        return ", ".join(f"{name} {value:.3g}" for name, value in self.values.items())


def errors_mm(of: Pushes, rod: Rod) -> Float64[np.ndarray, " P"]:
    """Mean distance of nodes of each push."""
    given = physics(rod.values, len(of.before))
    end = SIMULATE(given, RodState.along(jnp.asarray(of.before)), jnp.asarray(of.tool, jnp.float32))
    return 1e3 * np.linalg.norm(np.asarray(end.nodes[:, :2]) - of.after, axis=1).mean(1)


@cache
def contact_of(world: RopeModel, seed: int) -> Rod:
    """Frictions and contact that fit these pushes, with nominal bending."""
    return _fitted(pushes(world, seed), Rod(values={}), FITTED)[0]


@cache
def bending_of(world: RopeModel, seed: int, rod: Rod, *, again: bool) -> Rod:
    """Rigidity and lasting share that fit these pushes, with frictions and contact as they are or fitted `again`."""
    return _fitted_with_set(pushes(world, seed), rod, RIGIDITY | (FITTED if again else {}))


@cache
def set_of(world: RopeModel, seed: int, rod: Rod) -> Rod:
    """The lasting share that fits these pushes, with all else as it is."""
    return _fitted_with_set(pushes(world, seed), rod, {})


def _fitted_with_set(to: Pushes, rod: Rod, steps: Mapping[str, float]) -> Rod:
    """Fit as `_fitted`, with the lasting share."""
    fits = [_fitted(to, rod.but(permanent_set=start), {**steps, **SET}) for start in _SET_STARTS]
    return min(fits, key=lambda fit: fit[1])[0]


def _fitted(to: Pushes, rod: Rod, steps: Mapping[str, float]) -> tuple[Rod, float]:
    """The rod with those of its values that fit best, and its loss, in which pushes far off count less."""
    nominal = SCENE.nominal_physics() | {"climb": 0.4, "press": 0.6} | dict(rod.values)

    def made(x: np.ndarray) -> Rod:
        chosen = {
            name: nominal[name] * np.exp(by * step) if name in RIGIDITY else nominal[name] + by * step
            for by, (name, step) in zip(x.tolist(), steps.items(), strict=True)
        }
        return rod.but(**chosen)

    def residuals(x: np.ndarray) -> np.ndarray:
        return errors_mm(to, made(x)) / (1e3 * _SOFT_M)

    def slopes(x: np.ndarray) -> np.ndarray:
        sides = np.where(x + _ASIDE > high, -_ASIDE, _ASIDE)
        aside = [residuals(x + each) for each in np.diag(sides)]
        return (np.array(aside) - residuals(x)).T / sides

    ends = [
        ((0.0 - nominal[name]) / step, (1.0 - nominal[name]) / step) if name in SET else (-np.inf, np.inf)
        for name, step in steps.items()
    ]
    low, high = np.array(ends).T
    found = least_squares(
        residuals,
        np.zeros(len(steps)),
        slopes,  # pyright: ignore[reportArgumentType] - SciPy's types know its default alone
        bounds=(low, high),
        loss="cauchy",
        max_nfev=25,
    )
    return made(found.x), float(found.cost)


def itself_mm(world: RopeModel, seed: int) -> Float64[np.ndarray, " P"]:
    """Mean distance of nodes of each push from where it ends when its start is beside the true one."""
    rng, found = np.random.default_rng([seed, 1]), list[float]()
    for take in takes(world, seed):
        start = take.before.snapshot.nodes.copy()
        start[:, :2] += smooth_noise(rng, np.linspace(-1, 1, len(start)), BESIDE_M)
        end = push_again(TASK, ROPE_WORLDS[world], start, take.command)
        found.append(1e3 * float(np.linalg.norm((end - take.after.snapshot.nodes)[:, :2], axis=1).mean()))
    return np.array(found)


@cache
def clouds(world: RopeModel, seed: int) -> Float32[np.ndarray, "P N 3"]:
    """The rope before each push, as the cell's cameras and the reconstruction of their images show it."""
    return np.stack(
        [rendered(TASK, take.before.snapshot.nodes, number) for number, take in enumerate(takes(world, seed))]
    )


def seen_errors_mm(world: RopeModel, seed: int, rod: Rod) -> Float64[np.ndarray, " P"]:
    """Errors as `errors_mm`, of rods that begin where cameras see the rope, either end first."""
    of, x = pushes(world, seed), clouds(world, seed)
    start = RodState.at_rest(jnp.asarray(x), SCENE.nodes, SCENE.rest_m, SCENE.radius_m)
    end = np.asarray(SIMULATE(physics(rod.values, len(x)), start, jnp.asarray(of.tool, jnp.float32)).nodes[:, :2])
    return 1e3 * np.min([np.linalg.norm(line - of.after, axis=1).mean(1) for line in (end, end[..., ::-1])], axis=0)


def accuracy(world: RopeModel, cameras: bool) -> Iterator[tuple[str, ...]]:
    """Rows of errors on each set of a world's pushes: of no motion, of rods by their training data, of itself."""
    for other, seed in (SEEDS, SEEDS[::-1]):
        test = pushes(world, seed)
        own = contact_of(world, other)
        still = 1e3 * np.linalg.norm(test.before - test.after, axis=1).mean(1)
        yield world, str(seed), "no motion", *_spread(still)
        for name, rod in _rods(world, other):
            yield world, str(seed), f"{name}: {rod}", *_spread(errors_mm(test, rod))
        if cameras:
            yield world, str(seed), "contact fitted, seen by cameras", *_spread(seen_errors_mm(world, seed, own))
        yield world, str(seed), f"itself from starts {1e3 * BESIDE_M:.0f} mm beside", *_spread(itself_mm(world, seed))


def _rods(world: RopeModel, seed: int) -> Iterator[tuple[str, Rod]]:
    """Rods with parameters fitted to these pushes of this world, and to those of the chain."""
    own = contact_of(world, seed)
    if world != "chain":
        chain = bending_of("chain", seed, contact_of("chain", seed), again=True)
        yield f"all fitted to chain {seed}", chain
        yield "the same, but no bend lasts", chain.but(permanent_set=0.0)
        yield f"the same, but for the share that lasts, fitted to {world}", set_of(world, seed, chain)
        yield f"contact fitted to chain {seed}, bending to {world}", bending_of(world, seed, chain, again=False)
    yield f"contact fitted to {world} {seed}", own
    yield f"contact and bending fitted to {world} {seed}", bending_of(world, seed, own, again=True)


def _spread(errors_mm: Float64[np.ndarray, " P"]) -> tuple[str, ...]:
    """Count, median, mean, and 90th percentile."""
    numbers = np.median(errors_mm), errors_mm.mean(), np.percentile(errors_mm, 90)
    return str(len(errors_mm)), *(f"{number:.2f}" for number in numbers)


def timed(count: int) -> tuple[str, ...]:
    """Milliseconds of processors a push of 1.4 s, and with its gradient."""
    one = pushes("chain", SEEDS[0])
    which = np.arange(count) % len(one.before)
    tool = jnp.asarray(one.tool[which, : round(_TIMED_S / SCENE.dt_s) + 1], jnp.float32)
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


def main(options: Sequence[str] = ()) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", choices=(*get_args(RopeModel), "both"), default="both")
    parser.add_argument("--cameras", action="store_true", help="also from where cameras see the rope")
    asked = parser.parse_args(list(options))
    world = asked.world
    worlds: Sequence[RopeModel] = get_args(RopeModel) if world == "both" else (world,)
    console = Console(width=160)
    table = Table("world", "set", "rod, but for others", "pushes", "median, mm", "mean", "nine of ten below")
    for world in worlds:
        for row in accuracy(world, asked.cameras):
            table.add_row(*row)
    console.print(table)
    table = Table("candidates", "push, ms of a core", "with gradient")
    for count in (1, 16, 64, 256):
        table.add_row(*timed(count))
    console.print(table)


if __name__ == "__main__":
    main(sys.argv[1:])
