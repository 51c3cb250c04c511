"""Accuracy of a rope's centreline found from points: `python -m bench.centrelines [EPISODES] [PUSHES]`.

Random pushes in a row fold the rope of the simulated world, whose nodes are known. Its cloud is seen exactly, with
noise, with a hole, denser towards an end, as more particles, and by rendered cameras; errors are mean distances of
nodes at equal arc length, either end first. A tracked centreline is given what rods predict of the push, from the
centreline found before it.
"""

import sys
import time
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple, final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64
from rich.console import Console
from rich.table import Table

from app.core.geometry.track import Track
from app.core.types import Points
from app.policy.random_pushes import PushDesign
from app.rig.simulated.worlds.physics import WorldPhysics
from app.sim.rods.geometry.arc_length import arclength_labels
from app.sim.rods.geometry.centreline import through
from app.sim.rods.geometry.polyline import distance, of_equal_steps
from app.sim.rods.geometry.rope_cloud import RopeShape, Weighted
from app.sim.rods.geometry.verdict import assess
from app.sim.rods.state import RodState
from bench.photographs import rendered
from bench.rehearsal import rehearse
from bench.rods import SCENE, SIMULATE, TASK, physics

ROPE: Final = RopeShape(count=SCENE.nodes, rest_m=SCENE.rest_m, radius_m=SCENE.radius_m)
SEED: Final = 2
"""Seed of the pushes; scores were fitted to those of another."""
WRONG_MM: Final = 10.0
_FOLDED_M, _APART = 0.020, 5
_HOLE_M, _LIFTED_M, _REST_S = 0.015, 0.05, 0.3
_PRIOR: Final = {"climb": 0.5, "press": 0.5, "margin": 2.5e-4, "finger_friction": 0.26}


@final
class Start(NamedTuple):
    """Nodes (P, n, 3) of one episode after each push, and the paths (P, T, 3) of the finger."""

    nodes: Float64[np.ndarray, "P n 3"]
    tool: Float64[np.ndarray, "P T 3"]


@final
class Found(NamedTuple):
    """Errors [mm] of centrelines, and whether the verdict has nothing against each."""

    errors: Float64[np.ndarray, " P"]
    clear: np.ndarray


def episodes(count: int, pushes: int) -> list[Start]:
    """Episodes of random pushes, each up to 18 cm long."""
    takes = list(
        rehearse(TASK, PushDesign(episodes=count, pushes=pushes, lengths_m=(0.06, 0.18)), WorldPhysics(), (), SEED)
    )
    paths = [pushing(take.command) for take in takes]
    longest = max(map(len, paths)) + round(_REST_S / SCENE.dt_s)
    nodes = np.stack([take.after.snapshot.nodes for take in takes]).reshape(count, pushes, -1, 3)
    tool = np.stack([np.pad(path, ((0, longest - len(path)), (0, 0)), mode="edge") for path in paths])
    for way, path in zip(tool, paths, strict=True):
        way[len(path) :, 2] += 1.0
    tool = tool.reshape(count, pushes, longest, 3)
    return [Start(*each) for each in zip(nodes, tool, strict=True)]


def pushing(command: Track) -> Float64[np.ndarray, "T 3"]:
    """The part of a path in which the finger is low, a time step apart."""
    at = np.arange(command.times_s[0], command.times_s[-1], SCENE.dt_s)
    path = np.stack([np.interp(at, command.times_s, command.poses[:, axis]) for axis in range(3)], axis=1)
    return path[path[:, 2] < _LIFTED_M]


def exact(nodes: Float64[np.ndarray, "n 3"], seed: int) -> Points:
    """Cloud of the rope by perfect cameras."""
    del seed
    return TASK.particles(nodes, 300)


def noisy(nodes: Float64[np.ndarray, "n 3"], seed: int) -> Points:
    """Cloud with a noise of 1.5 mm along each axis."""
    x = TASK.particles(nodes, 300)
    return (x + 0.0015 * np.random.default_rng(seed).standard_normal(x.shape)).astype(np.float32)


def holed(nodes: Float64[np.ndarray, "n 3"], seed: int) -> Points:
    """Cloud with a hole of 15 mm about a place of the rope, and 1 mm of noise."""
    rng, x = np.random.default_rng(seed), TASK.particles(nodes, 330)
    hidden = nodes[rng.integers(4, len(nodes) - 4), :2]
    x = x[np.linalg.norm(x[:, :2] - hidden, axis=1) > _HOLE_M]
    return (x + 0.001 * rng.standard_normal(x.shape)).astype(np.float32)


def uneven(nodes: Float64[np.ndarray, "n 3"], seed: int) -> Points:
    """Cloud that is twice as dense at the rope's last end as at its first, of points at random, and 1 mm of noise."""
    rng, x = np.random.default_rng(seed), TASK.particles(nodes, 1200)
    nearest = np.linalg.norm(x[:, None, :2] - nodes[None, :, :2], axis=2).argmin(1)
    chance = 2.0 ** (nearest / (len(nodes) - 1))
    x = x[rng.choice(len(x), 300, replace=False, p=chance / chance.sum())]
    return (x + 0.001 * rng.standard_normal(x.shape)).astype(np.float32)


def dense(nodes: Float64[np.ndarray, "n 3"], seed: int) -> Points:
    """Cloud of as many particles as on a GPU."""
    del seed
    return TASK.particles(nodes, 2000)


def seen(nodes: Float64[np.ndarray, "n 3"], seed: int) -> Points:
    """Cloud by the simulated cell's cameras."""
    return rendered(TASK, nodes, seed)


SEEN: Final[tuple[Callable[[Float64[np.ndarray, "n 3"], int], Points], ...]] = (
    exact,
    noisy,
    holed,
    uneven,
    dense,
    seen,
)


def folded(line: Float64[np.ndarray, "n 2"]) -> bool:
    """True if strands are nearer than 20 mm."""
    gap = np.linalg.norm(line[:, None] - line[None], axis=-1)
    return bool(gap[np.subtract.outer(np.arange(len(line)), np.arange(len(line))) >= _APART].min() < _FOLDED_M)


def by_neighbours(x: Points) -> Float64[np.ndarray, "n 2"]:
    """The centreline in the order of distances between neighbours."""
    at = x[:, :2].astype(np.float64)
    even = np.full(len(at), 1 / len(at))
    cloud = Weighted(at=at, share=even, variance=np.ones(len(at)), origin=np.zeros(2))
    place = (ROPE.count - 1) * arclength_labels(x).astype(np.float64)
    return of_equal_steps(through(place[None], cloud, ROPE.count, 1.0), ROPE.rest_m)[0]


def predicted(line: Float64[np.ndarray, "n 2"], tool: Float64[np.ndarray, "T 3"]) -> Float64[np.ndarray, "n 2"]:
    """The centreline after a push, as rods predict it."""
    start = RodState.along(jnp.asarray(line.T[None]))
    end = SIMULATE(physics(_PRIOR, 1), start, jnp.asarray(tool[None], jnp.float32))
    return np.asarray(end.nodes[0, :2], np.float64).T


def followed(of: list[Start], clouds: list[Points], *, tracked: bool) -> Found:
    """Errors and verdicts of all pushes, whose clouds are in order."""
    errors, clear, left = list[float](), list[bool](), iter(clouds)
    for nodes, tool in of:
        near = None
        for push, now in enumerate(nodes):
            verdict = assess(next(left), ROPE, near)
            errors.append(1e3 * distance(verdict.line, now[:, :2]))
            clear.append(not verdict.problems)
            if tracked and push + 1 < len(nodes):
                near = predicted(verdict.line, tool[push + 1])
    return Found(np.array(errors), np.array(clear))


def rows(of: list[Start]) -> Iterator[tuple[str, ...]]:
    """Lines of the table."""
    lines = [now[:, :2] for start in of for now in start.nodes]
    fold = np.array([folded(line) for line in lines])
    for see in SEEN:
        clouds = [see(now, k) for k, now in enumerate(_all(of))]
        pairs = zip(clouds, lines, strict=True)
        old = [1e3 * distance(by_neighbours(cloud), line) for cloud, line in pairs]
        every = np.ones(len(lines), bool)
        found = {"neighbours": Found(np.array(old), every)}
        found |= {name: followed(of, clouds, tracked=name == "tracked") for name in ("orders", "tracked")}
        for name, (errors, clear) in found.items():
            for where, which in (("open", ~fold), ("folded", fold)):
                yield getattr(see, "__name__", ""), name, where, *_summary(errors[which], clear[which])


def _all(of: list[Start]) -> list[Float64[np.ndarray, "n 3"]]:
    return [now for start in of for now in start.nodes]


def _summary(errors: np.ndarray, clear: np.ndarray) -> tuple[str, ...]:
    wrong = errors > WRONG_MM
    silent = f"{100 * wrong[clear].mean():.1f}" if clear.any() else "-"
    return (
        str(len(errors)),
        f"{np.median(errors):.1f} / {np.percentile(errors, 95):.1f}",
        f"{100 * wrong.mean():.1f}",
        f"{100 * clear.mean():.0f}",
        silent,
    )


def main() -> None:
    """Print the table, and the time of one centreline with its verdict."""
    count, pushes = (int(each) for each in (*sys.argv[1:], *("8", "15")[len(sys.argv) - 1 :]))
    of = episodes(count, pushes)
    table = Table("cloud", "order", "rope", "n", "median / 95 %, mm", "> 10 mm, %", "clear, %", "> 10 mm of clear, %")
    for row in rows(of):
        table.add_row(*row)
    console = Console(width=120)
    console.print(table)
    clouds = [exact(now, 0) for now in _all(of)]
    began_s = time.process_time()
    for cloud in clouds:
        assess(cloud, ROPE)
    console.print(f"{1e3 * (time.process_time() - began_s) / len(clouds):.0f} ms of processors a cloud")


if __name__ == "__main__":
    main()
