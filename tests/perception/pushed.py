"""Images that the simulated cell's cameras take of a rope while the finger pushes it."""

import numpy as np

from app.core.messages import Frame, fresh_id
from app.rig.simulated.cameras.cameras import table_cameras
from app.rig.simulated.cameras.render import render
from app.rig.simulated.worlds.rope_world import RopeWorld
from app.rig.simulated.worlds.world import Snapshot
from app.tasks import load

TASK = load("rope_push")
_LIFT_M = np.array([0.0, 0.0, 0.06])


def pushing(seed: int) -> Snapshot:
    """Snapshot with the finger in the middle of a push across some place of the rope."""
    rng = np.random.default_rng(seed)
    world = RopeWorld(TASK.rope, TASK.finger, TASK.start(seed))
    world.step(world.tool, 0.2)
    place = np.array([*world.nodes()[rng.integers(3, 30), :2], TASK.finger.push_height_m])
    angle = rng.uniform(0, 2 * np.pi)
    ahead = np.array([np.cos(angle), np.sin(angle), 0.0])
    first = place - 0.03 * ahead
    for waypoint in (first + _LIFT_M, first, place + 0.04 * ahead):
        world.step(waypoint, 0.4)
    return world.snapshot()


def photographed(snapshot: Snapshot, seed: int, cameras: int = 2) -> list[Frame]:
    """Frames of the snapshot from so many cameras."""
    rng, frames = np.random.default_rng(seed), list[Frame]()
    for camera in table_cameras(cameras):
        color, depth = render(snapshot, camera, rng, stage=TASK.stage)
        frames.append(Frame(id=fresh_id("frame"), time_s=snapshot.time_s, camera=camera, color=color, depth=depth))
    return frames
