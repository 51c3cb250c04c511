"""The cameras of a push session: images of a snapshot, with injected errors."""

from collections.abc import Sequence
from dataclasses import replace
from typing import final

import numpy as np

from app.core.geometry.camera import CameraModel
from app.core.geometry.scene_description import Stage
from app.core.messages import Frame, MessageId
from app.rig.simulated.cameras.cameras import CameraNoise, table_cameras
from app.rig.simulated.cameras.render import render
from app.rig.simulated.injected_effects.base import InjectedEffect, SensorImages
from app.rig.simulated.worlds.world import Snapshot

_NOISE = 3
"""Random stream of the images' noise."""


@final
class SimulatedCameras:
    """Cameras whose true pose and images may differ from their calibration.

    `count`: from one to three; `noise`: of their images.
    """

    def __init__(
        self,
        stage: Stage,
        hidden: Sequence[InjectedEffect],
        seed: int,
        *,
        count: int = 2,
        noise: CameraNoise | None = None,
    ) -> None:
        self._stage, self._hidden, self._seed, self._noise = stage, tuple(hidden), seed, noise
        self.cameras = table_cameras(count)
        middle = np.mean([camera.T_world_camera[:3, 3] for camera in self.cameras], axis=0)
        self._standing = [_standing(camera, middle, hidden) for camera in self.cameras]

    def look(self, snapshot: Snapshot, *, stamp_s: float, number: int) -> list[Frame]:
        """Frames of all cameras, stamped `stamp_s`; `number` counts the views of a session, each with its own noise."""
        rng = np.random.default_rng([self._seed, _NOISE, number])
        frames = list[Frame]()
        for index, (believed, standing) in enumerate(zip(self.cameras, self._standing, strict=True)):
            color, depth = render(snapshot, standing, rng, stage=self._stage, noise=self._noise)
            for each in self._hidden:
                if each.effect.seen is not None:
                    depth = each.effect.seen(SensorImages(color, depth, believed, self._stage.body.colour), each.values)
            identity = MessageId(f"frame-{number * len(self.cameras) + index:06d}")
            frames.append(Frame(id=identity, time_s=stamp_s, camera=believed, color=color, depth=depth))
        return frames


def _standing(camera: CameraModel, middle: np.ndarray, hidden: Sequence[InjectedEffect]) -> CameraModel:
    """The camera at its true pose."""
    pose = camera.T_world_camera
    for each in hidden:
        if each.effect.stands is not None:
            pose = each.effect.stands(pose, middle, each.values)
    return replace(camera, T_world_camera=pose)
