"""The cameras' own process: exposes every camera once a period and leaves the images in shared memory."""

import os
import time
from collections.abc import Mapping

import numpy as np

from app.arm.memory import ArmMemory
from app.core.geometry.camera import CameraModel
from app.core.geometry.scene_description import Stage
from app.core.system.ring import Ring
from app.core.types import ColourImage, DepthImage, ToolPose
from app.rig.simulated.cameras.held_board import HeldBoard, paint
from app.rig.simulated.cameras.render import render
from app.rig.simulated.world_process import newest_snapshot
from app.rig.simulated.worlds.world import Snapshot

_NICENESS = 5
_RECENT = 500
"""States of the arm kept for lookup, five seconds of them: a slower world shows the past."""


def run_cameras(
    arm: ArmMemory,
    snapshots: Ring,
    images: dict[str, Ring],
    cameras: tuple[CameraModel, ...],
    depth_views: Mapping[str, CameraModel],
    stage: Stage,
    period_s: float,
    seed: int,
    parent: int,
    held: HeldBoard | None = None,
) -> None:
    """Body of the process: expose until closed or until `parent` is gone.

    `depth_views`: models of the depth cameras, by camera, where they differ from the colour cameras. Images are dated
    with the moment of the world that they show. Too slow a machine gives fewer images, never old ones, and a world
    whose time stands still gives none. A `held` board is in the gripper.
    """
    os.nice(_NICENESS)
    rng = np.random.default_rng(seed)
    due, shown_s = time.monotonic(), -np.inf
    while not arm.closing.value and os.getppid() == parent:
        snapshot = newest_snapshot(snapshots)
        if snapshot is not None and snapshot.time_s > shown_s:
            shown_s = snapshot.time_s
            board = (held, _hand(arm, snapshot.time_s)) if held is not None else None
            for camera in cameras:
                color, depth = _render_images(snapshot, camera, rng, stage, board)
                if camera.name in depth_views:
                    _, depth = _render_images(snapshot, depth_views[camera.name], rng, stage, board)
                images[camera.name].append(time_s=snapshot.time_s, color=color, depth=depth)
        due = max(due + period_s, time.monotonic())
        time.sleep(max(0.0, due - time.monotonic()))


def _render_images(
    snapshot: Snapshot,
    camera: CameraModel,
    rng: np.random.Generator,
    stage: Stage,
    board: tuple[HeldBoard, ToolPose] | None,
) -> tuple[ColourImage, DepthImage]:
    color, depth = render(snapshot, camera, rng, stage=stage)
    return paint(*board, camera, color, depth, rng) if board is not None else (color, depth)


def _hand(arm: ArmMemory, time_s: float) -> ToolPose:
    """Pose of the arm's hand at `time_s`; the tool of a world may not turn with it."""
    states = arm.states.since(max(arm.states.count - _RECENT, 0))
    return np.array(states["measured"][np.argmin(np.abs(states["time_s"] - time_s))])
