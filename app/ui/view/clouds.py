"""Point clouds over the scene, to check the cameras' poses by: each camera's, and the fused surface."""

from typing import Final, Literal, NamedTuple, TypeAlias, final, get_args

import numpy as np
import viser
from jaxtyping import Float32, UInt8

from app.core.messages import Frame, Particles
from app.ui.parts import palette
from app.ui.parts.console_state import ConsoleState

Show: TypeAlias = Literal["off", "by camera", "as seen"]
SHOWN: Final[tuple[Show, ...]] = get_args(Show)
"""No clouds; each camera's in a colour of its own; each point in its colour in the image."""
SURFACE: Final = "fused surface"
_MOST = 5000
_POINT_M = 0.0025
_BELOW_M, _ABOVE_M = -0.05, 0.6
"""Range of heights of the table and the objects on it; the rest is background, or no reading."""


class Cloud(NamedTuple):
    """Points [m, world] and their colours."""

    points: Float32[np.ndarray, "points 3"]
    colours: UInt8[np.ndarray, "points 3"]


@final
class Clouds:
    """The point clouds of one server's scene. Painted by the painter's thread; the switches are set by any."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene
        self.cameras: Show = "off"
        self.surface = False
        self.handles: dict[str, viser.PointCloudHandle] = {}
        self._drawn: dict[str, object] = {}

    def paint(self, state: ConsoleState) -> None:
        """Draw the enabled clouds, where there is something newer; remove the others."""
        show = self.cameras
        wanted = dict[str, tuple[object, Show]]()
        if show != "off":
            wanted |= {name: (frame, show) for name, frame in state.frames.items()}
        if self.surface and state.particles is not None:
            wanted[SURFACE] = state.particles, "off"
        for name in self.handles.keys() - wanted.keys():
            self.handles.pop(name).remove()
            self._drawn.pop(name)
        for number, (name, drawn) in enumerate(wanted.items()):
            if self._drawn.get(name) != drawn:
                self._drawn[name] = drawn
                self._draw(name, _cloud(drawn[0], show, number))

    @property
    def counts(self) -> dict[str, int]:
        """Number of drawn points of each cloud."""
        return {name: len(handle.points) for name, handle in self.handles.items()}

    def _draw(self, name: str, cloud: Cloud) -> None:
        if name in self.handles:
            self.handles[name].points, self.handles[name].colors = cloud.points, cloud.colours
            return
        self.handles[name] = self._scene.add_point_cloud(
            f"/clouds/{name}",
            cloud.points,
            cloud.colours,
            point_size=_POINT_M,
            point_shape="rounded",
            precision="float32",
            point_shading="flat",
        )


def _cloud(of: object, show: Show, number: int) -> Cloud:
    match of:
        case Frame():
            cloud = readings(of)
            return cloud if show == "as seen" else Cloud(cloud.points, _all(cloud.points, palette.camera(number)))
        case Particles():
            points = of.surface[:: max(len(of.surface) // _MOST, 1)]
            return Cloud(points, _all(points, palette.SURFACE))
        case _:
            raise TypeError(type(of))


def readings(frame: Frame) -> Cloud:
    """At most about 5000 readings of a camera on and over the table, as points of the world with their colours."""
    camera, step = frame.camera, max(round((frame.depth.size / _MOST) ** 0.5), 1)
    rows, columns = (axis.ravel() for axis in np.mgrid[: camera.height : step, : camera.width : step])
    z = frame.depth[rows, columns].astype(np.float64) * camera.depth_unit_m
    rays = np.stack([columns, rows, np.ones(len(rows))], axis=1) @ np.linalg.inv(camera.K).T
    pose = camera.T_world_camera
    points = (z[:, None] * rays) @ pose[:3, :3].T + pose[:3, 3]
    keep = (z > 0) & (points[:, 2] > _BELOW_M) & (points[:, 2] < _ABOVE_M)
    return Cloud(points[keep].astype(np.float32), frame.color[rows, columns][keep])


def _all(points: np.ndarray, colour: palette.Colour) -> UInt8[np.ndarray, "points 3"]:
    return np.tile(np.array(colour, np.uint8), (len(points), 1))
