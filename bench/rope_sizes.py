"""Lengths of ropes that nobody measured, from clouds of them, and whether their errors hold. See `--help`.

Made-up ropes lie in gentle bends: of 25 to 60 cm, 4 to 10 mm in radius, in a few clouds of 450 points each, filled or
as a surface, cut off or with round ends, with noise. Then ropes of tasks, as the simulated cell's two cameras see them.
"""

from collections.abc import Iterator

import numpy as np
import tyro

from app.config import Workspace
from app.core.types import Cloud
from app.sim.rods.geometry.rope_size import RopeSize, rope_size
from app.tasks import load
from app.tasks.elements.base import Nodes
from app.tasks.elements.curves import fill_tube, random_curve
from bench.photographs import reconstruction

NOISE_M = (0.0005, 0.0018, 0.0025)
TASKS = ("rope_push(length_m=0.25,radius_m=0.005)", "rope_push", "rope_push(length_m=0.6,radius_m=0.01)")
CLOUDS = {"filled, cut off": (True, False), "surface, cut off": (False, False), "surface, round ends": (False, True)}
"""Kinds of made-up clouds: true or false for filled, and for round ends."""
_POINTS, _GAP_RADII = 450, 5
_NINETY = 1.645
"""Standard deviations on either side that hold 90 % of normal numbers."""


def surface(nodes: Nodes, radius_m: float, rng: np.random.Generator, *, rounded: bool) -> Cloud:
    """Points at random of a lying rope's upper half."""
    edges = np.diff(nodes[:, :2], axis=0)
    arc_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(edges, axis=1))])
    end_m = radius_m if rounded else 0.0
    at, around = rng.uniform(-end_m, arc_m[-1] + end_m, _POINTS), rng.uniform(-np.pi / 2, np.pi / 2, _POINTS)
    inside = np.clip(at, 0.0, arc_m[-1])
    ahead = edges[np.clip(np.searchsorted(arc_m, inside) - 1, 0, len(edges) - 1)]
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    thick_m = np.sqrt(radius_m**2 - (at - inside) ** 2)
    middle = np.stack([np.interp(inside, arc_m, nodes[:, axis]) for axis in range(2)], axis=1)
    side = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    flat = middle + (at - inside)[:, None] * ahead + (thick_m * np.sin(around))[:, None] * side
    return np.column_stack([flat, radius_m + thick_m * np.cos(around)]).astype(np.float32)


def made_up(seed: int, noise_m: float, clouds: int, *, filled: bool, rounded: bool) -> tuple[float, RopeSize]:
    """True length of a rope [m], and its size from so many clouds of it."""
    rng = np.random.default_rng([seed, round(1e6 * noise_m)])
    length_m, radius_m = rng.uniform(0.25, 0.60), rng.uniform(0.004, 0.010)
    seen = list[Cloud]()
    for _ in range(clouds):
        nodes = random_curve(
            rng, length_m=length_m, height_m=radius_m, workspace=Workspace(), min_gap_m=_GAP_RADII * radius_m
        )
        x = fill_tube(nodes, radius_m, _POINTS) if filled else surface(nodes, radius_m, rng, rounded=rounded)
        seen.append((x + noise_m * rng.standard_normal(x.shape)).astype(np.float32))
    return length_m, rope_size(seen)


def rows(ropes: int, clouds: int) -> Iterator[str]:
    """Lines of the table: errors of lengths [mm], and how many of them are within 90 % intervals."""
    for kind, (filled, rounded) in CLOUDS.items():
        for noise_m in NOISE_M:
            found = [made_up(seed, noise_m, clouds, filled=filled, rounded=rounded) for seed in range(ropes)]
            errors = np.array([size.length_m - length_m for length_m, size in found])
            held = np.abs(errors) < _NINETY * np.array([size.length_sd_m for _, size in found])
            low, middle, high = 1e3 * np.quantile(errors, [0.05, 0.5, 0.95])
            yield f"| {kind} | {1e3 * noise_m:.1f} | {middle:.1f} ({low:.1f} to {high:.1f}) | {held.sum()} of {ropes} |"
    for name in TASKS:
        task = load(name)
        size = rope_size([reconstruction(task, task.start(seed), seed).surface for seed in range(clouds)])
        error = size.length_m - task.rope.length_m
        held = abs(error) < _NINETY * size.length_sd_m
        yield f"| `{name}`, cameras | | {1e3 * error:.1f} | {int(held)} of 1 |"


def main(ropes: int = 12, clouds: int = 4) -> None:
    """Print the table."""
    print("| Clouds | Noise [mm] | Error of the length [mm], median (90 %) | In its 90 % interval |\n|---|---|---|---|")
    for row in rows(ropes, clouds):
        print(row, flush=True)


if __name__ == "__main__":
    tyro.cli(main)
