"""Accuracy and speed of the reconstruction of the simulated cell's ropes: `python -m bench.perception`.

The world's truth is the tube about its rope's nodes. Two situations a seed: the rope at rest with the arm aside, and
after a push, with the finger still at the rope.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias, final

import cv2
import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.spatial import KDTree

from app.core.messages import Frame, fresh_id
from app.perception.body.fill import fill, points_inside
from app.perception.body.resample import resample
from app.perception.reconstruct import Reconstruction, reconstruct
from app.rig.simulated.cameras.cameras import table_cameras
from app.rig.simulated.cameras.render import render
from app.rig.simulated.worlds.rope_world import RopeWorld
from app.rig.simulated.worlds.world import Snapshot
from app.tasks.rope_push import TASK
from bench.tube import Tube

_SETTLE_S, _PUSH_S = 0.5, 1.0
_LIFT_M, _PUSH_M = np.array([0.0, 0.0, 0.2]), np.array([0.0, 0.08, 0.0])
_SAMPLES = 10_000
_SPACING_M = 0.0015
_REPEATS = 20

Quantiles: TypeAlias = tuple[float, float, float]
"""Least, median and 99th percentile."""


@final
@dataclass(frozen=True, kw_only=True)
class Score:
    """One reconstruction against the truth; distances in mm.

    `out`: from the particles to the rope, mean and 95th percentile. `back`: from the rope's volume to the nearest
    particle's centre, and `ideal`: its mean where as many particles fill the true rope by the same method, so that
    count alone keeps them apart. `uncovered`: to the nearest of the balls that the particles' equal shares of the
    volume make. `height`: of the particles' centroid over the rope's; `radius`: of the filled body's cross-section over
    the rope's; `volume`: relative to the rope's.
    """

    out: tuple[float, float]
    back: tuple[float, float]
    ideal: float
    uncovered: tuple[float, float]
    height: float
    radius: float
    volume: float
    cpu_ms: Quantiles
    wall_ms: Quantiles


def main(seeds: int = 10) -> None:
    """Print a row a situation."""
    table = Table(
        "situation",
        "out mean p95",
        "back mean p95",
        "ideal",
        "uncovered",
        "height",
        "radius",
        "volume",
        "cpu ms",
        "wall ms",
    )
    table.caption = "Distances in mm; times of a pair of 640x480 frames on one thread: least, median, p99."
    cv2.setNumThreads(1)
    for name, score in scores(seeds):
        table.add_row(
            name,
            *(f"{mean:.2f} {p95:.2f}" for mean, p95 in (score.out, score.back)),
            f"{score.ideal:.2f}",
            f"{score.uncovered[0]:.2f} {score.uncovered[1]:.2f}",
            *(f"{value:.2f}" for value in (score.height, score.radius, score.volume)),
            *(" ".join(f"{value:.0f}" for value in times) for times in (score.cpu_ms, score.wall_ms)),
        )
    Console(width=140).print(table)


def scores(seeds: int) -> Iterator[tuple[str, Score]]:
    """The score of each situation, by name."""
    for seed in range(seeds):
        for name, snapshot in _situations(seed):
            tube = Tube(curve=snapshot.nodes, radius_m=TASK.rope.radius_m)
            yield f"{seed} {name}", _score(_frames(snapshot, np.random.default_rng(seed)), TASK.perception, tube)


def _situations(seed: int) -> Iterator[tuple[str, Snapshot]]:
    """The rope at rest, then after a push across its middle."""
    world = RopeWorld(TASK.rope, TASK.finger, TASK.start(seed))
    world.step(world.tool, _SETTLE_S)
    yield "at rest", world.snapshot()
    middle = world.nodes()[len(world.nodes()) // 2]
    start = np.array([*middle[:2], TASK.finger.push_height_m]) - _PUSH_M / 2
    for waypoint in (start + _LIFT_M, start, start + _PUSH_M):
        world.step(waypoint, _PUSH_S)
    yield "pushed", world.snapshot()


def _frames(snapshot: Snapshot, rng: np.random.Generator) -> list[Frame]:
    frames: list[Frame] = []
    for camera in table_cameras():
        color, depth = render(snapshot, camera, rng, stage=TASK.stage)
        frame_id = fresh_id("frame")
        frames.append(Frame(id=frame_id, time_s=snapshot.time_s, camera=camera, color=color, depth=depth))
    return frames


def _score(frames: Sequence[Frame], how: Reconstruction, tube: Tube) -> Score:
    seen = reconstruct(frames, how)
    body = fill(seen.surface, table_m=how.table_m, half_width_m=how.half_width_m, underside=how.underside)
    truth = tube.samples(_SAMPLES, np.random.default_rng(0)).astype(np.float32)
    even = tube.samples(_SAMPLES, np.random.default_rng(1)).astype(np.float32)
    ideal = resample(even, how.particle_count, seed=0)
    cpu_ms, wall_ms = _times_ms(frames, how)
    return Score(
        out=_mean_p95_mm(tube.outside(seen.positions)),
        back=_mean_p95_mm(KDTree(seen.positions).query(truth)[0]),
        ideal=_mean_p95_mm(KDTree(ideal).query(truth)[0])[0],
        uncovered=_mean_p95_mm(tube.uncovered(truth, seen.positions)),
        height=1e3 * float(seen.positions[:, 2].mean() - truth[:, 2].mean()),
        # In a disc the mean distance to the axis is two thirds of the radius.
        radius=1e3 * float(1.5 * tube.distance_to_axis(points_inside(body, _SPACING_M)).mean() - tube.radius_m),
        volume=body.volume_m3 / tube.volume_m3,
        cpu_ms=cpu_ms,
        wall_ms=wall_ms,
    )


def _mean_p95_mm(distance_m: np.ndarray) -> tuple[float, float]:
    return 1e3 * float(distance_m.mean()), 1e3 * float(np.quantile(distance_m, 0.95))


def _times_ms(frames: Sequence[Frame], how: Reconstruction) -> tuple[Quantiles, Quantiles]:
    """Least, median and 99th percentile of the CPU time and of the wall time of a reconstruction [ms]."""
    times = np.empty((_REPEATS, 2))
    for row in times:
        start = np.array([time.process_time(), time.perf_counter()])
        reconstruct(frames, how)
        row[:] = [time.process_time(), time.perf_counter()] - start
    (cpu_least, wall_least), (cpu, wall), (cpu_p99, wall_p99) = 1e3 * np.quantile(times, [0.0, 0.5, 0.99], axis=0)
    return (cpu_least, cpu, cpu_p99), (wall_least, wall, wall_p99)


if __name__ == "__main__":
    main()
