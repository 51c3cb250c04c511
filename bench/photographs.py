"""Objects as the simulated cell's cameras, and the reconstruction of their images, show them."""

import numpy as np

from app.core.messages import Frame, fresh_id
from app.core.motion import pointing_down
from app.core.types import Points
from app.perception.reconstruct import Reconstructed, reconstruct
from app.rig.simulated.cameras.cameras import table_cameras
from app.rig.simulated.cameras.render import render
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.physics import HOME_TOOL_M
from app.rig.simulated.worlds.world import Snapshot
from app.tasks.elements.base import Nodes, Task


def rendered(task: Task, nodes: Nodes, seed: int) -> Points:
    """Particles of the task's object, unmoving at `nodes`, with the arm at home."""
    return reconstruction(task, nodes, seed).positions


def reconstruction(task: Task, nodes: Nodes, seed: int) -> Reconstructed:
    """The same, with the surface that was seen."""
    tool, rng, frames = pointing_down(np.array(HOME_TOOL_M)), np.random.default_rng(seed), list[Frame]()
    snapshot = Snapshot(time_s=0.0, nodes=nodes, tool=tool, joints=solve_joints(tool))
    for camera in table_cameras():
        color, depth = render(snapshot, camera, rng, stage=task.stage)
        frames.append(Frame(id=fresh_id("frame"), time_s=0.0, camera=camera, color=color, depth=depth))
    return reconstruct(frames, task.perception)
