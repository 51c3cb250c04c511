"""The simulated world measured: its physics, and its cameras.

`python -m bench.world` prints one table. CPU times are of the process that does the work, so a busy machine changes
them little.
"""

import time
from collections.abc import Iterator

import numpy as np

from app.core.geometry.scene_description import Rope, Stage
from app.core.geometry.shapes.tools import Finger
from app.rig.simulated.cameras.cameras import table_cameras
from app.rig.simulated.cameras.render import render
from app.rig.simulated.kinds import kind_of
from app.rig.simulated.worlds.rope_world import RopeWorld
from app.tasks import load

ROPE = Rope(length_m=0.40, radius_m=0.008, mass_kg=0.08, colour=(0.9, 0.25, 0.08))
FINGER = Finger(radius_m=0.009, push_height_m=0.006)
_TICK_S, _STILL_M_S = 0.01, 2e-3
_SWAYS, _SWAY_S, _SWAY_M = 6, 0.2, 0.002


def main() -> None:
    """Print the table."""
    rows = [*_world_rows(), *_liquid_rows(), *_camera_rows()]
    width = max(len(name) for name, _ in rows)
    for name, value in rows:
        print(f"{name:<{width}}  {value}")


def _straight() -> np.ndarray:
    y = np.linspace(-ROPE.length_m / 2, ROPE.length_m / 2, 81)
    return np.stack([np.full_like(y, 0.5), y, np.full_like(y, ROPE.radius_m)], axis=1)


def _world_rows() -> Iterator[tuple[str, str]]:
    for speed in (0.1, 0.2, 0.3):
        real_time, settle_s = _pushed(speed)
        yield f"world, push at {speed} m/s", f"{real_time:.1f} x real time while pushed, settles in {settle_s:.2f} s"


def _pushed(speed_m_s: float) -> tuple[float, float]:
    """Simulated per CPU second while the finger pushes, and seconds until every node is slower than 2 mm/s."""
    world = RopeWorld(ROPE, FINGER, _straight())
    begin, end = np.array([0.46, 0.02, FINGER.push_height_m]), np.array([0.64, 0.05, FINGER.push_height_m])
    world.place(begin)
    ticks = round(float(np.linalg.norm(end - begin)) / speed_m_s / _TICK_S)
    started = time.process_time()
    for tick in range(1, ticks + 1):
        world.step(begin + (end - begin) * tick / ticks, _TICK_S)
    spent_s = time.process_time() - started
    settle_s, last = 0.0, world.nodes()
    for tick in range(1, 151):
        world.step(end, _TICK_S)
        now = world.nodes()
        if np.linalg.norm(now - last, axis=1).max() / _TICK_S > _STILL_M_S:
            settle_s = tick * _TICK_S
        last = now
    return ticks * _TICK_S / spent_s, settle_s


def _liquid_rows() -> Iterator[tuple[str, str]]:
    for name in ("pour_water", "pour_soup"):
        task = load(name)
        world = kind_of(task.stage).build(task.stage, task.start(0), 0.0)
        here = world.tool
        there = here + np.array([_SWAY_M, 0, 0, 0, 0, 0, 0, 0])
        world.step(there, _SWAY_S)
        started = time.process_time()
        for sway in range(_SWAYS):
            world.step(there if sway % 2 else here, _SWAY_S)
        share = _SWAYS * _SWAY_S / (time.process_time() - started)
        yield f"world, {name}, its bowl swayed", f"{share:.2f} x real time"


def _camera_rows() -> Iterator[tuple[str, str]]:
    rng, camera = np.random.default_rng(0), table_cameras()[0]
    for name, tool in (("arm at home", (0.3, 0.0, 0.3)), ("arm over the rope", (0.5, 0.05, 0.12))):
        snapshot = RopeWorld(ROPE, FINGER, _straight(), tool=tool).snapshot()
        spent_ms: list[float] = []
        for _ in range(12):
            started = time.process_time()
            render(snapshot, camera, rng, stage=Stage(body=ROPE, tool=FINGER))
            spent_ms.append((time.process_time() - started) * 1e3)
        yield f"render a 640x480 view, {name}", f"{np.median(spent_ms[2:]):.0f} ms CPU"


if __name__ == "__main__":
    main()
