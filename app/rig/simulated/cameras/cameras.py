"""Poses of the simulated RGB-D cameras, and the noise of their images."""

from dataclasses import dataclass
from typing import Self, final

import numpy as np

from app.core.geometry.camera import CameraModel
from app.core.types import Transform

TABLE_CENTRE_M = (0.55, 0.0, 0.0)
DEPTH_UNIT_M = 0.001
_WIDTH, _HEIGHT, _FOCAL_PX = 640, 480, 605.0
_DISTANCE_M, _ELEVATION_RAD, _AIM_NEARER_M = 0.80, np.radians(52.0), 0.05


@final
@dataclass(frozen=True, kw_only=True)
class CameraNoise:
    """Noise model of a stereo depth camera of the D400 kind.

    Depth noise grows with the square of depth, as disparity noise does: 2e-3 / m is 1 mm at 0.7 m. A pixel loses its
    depth, with `edge_dropout` probability, where depth jumps by more than `edge_m` to a neighbour, and with
    `grazing_dropout` where the surface is seen at a smaller angle to it than `grazing_rad`.
    """

    depth_per_m: float = 2.0e-3
    edge_m: float = 0.010
    edge_dropout: float = 0.5
    grazing_rad: float = 0.20
    grazing_dropout: float = 0.8
    colour_levels: float = 2.0

    @classmethod
    def of_depth(cls, noise_m: float) -> Self:
        """Noise with this standard deviation of depth [m] at the distance of the cell's cameras."""
        return cls(depth_per_m=noise_m / _DISTANCE_M**2)


def table_cameras(count: int = 2) -> tuple[CameraModel, ...]:
    """`count` cameras evenly around the table, the first at its left (+y), all looking down at its middle.

    Each aims a little nearer than the centre, so that the near edge of the workspace is in its image too.
    """
    turns = np.pi / 2 + np.arange(count) * 2 * np.pi / count
    return tuple(_camera(f"camera{index}", turn) for index, turn in enumerate(turns))


def _camera(name: str, turn: float) -> CameraModel:
    centre = np.array(TABLE_CENTRE_M)
    aside = np.array([np.cos(turn), np.sin(turn), 0.0])
    away = aside * np.cos(_ELEVATION_RAD) + [0.0, 0.0, np.sin(_ELEVATION_RAD)]
    return CameraModel(
        name=name,
        width=_WIDTH,
        height=_HEIGHT,
        K=np.array([[_FOCAL_PX, 0, (_WIDTH - 1) / 2], [0, _FOCAL_PX, (_HEIGHT - 1) / 2], [0, 0, 1]]),
        T_world_camera=_looking(centre + _DISTANCE_M * away, centre + _AIM_NEARER_M * aside),
        depth_unit_m=DEPTH_UNIT_M,
    )


def _looking(eye: np.ndarray, target: np.ndarray) -> Transform:
    """`T_world_camera` of a camera at `eye` that looks at `target` with the horizon level (x right, y down)."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :] = np.column_stack([right, np.cross(forward, right), forward, eye])
    return pose
