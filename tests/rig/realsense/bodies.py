"""Small cameras, and the scene before them: a plane with a box before it."""

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from app.rig.realsense.sdk.software import CameraDescription, Imager
from app.rig.realsense.sdk.synthetic import ImagerPair

WIDTH, HEIGHT, RATE_HZ = 160, 120, 30
UNIT_M = 0.00025
PLANE_M, BOX_M = 0.80, 0.50
HALF_M = (0.050, 0.040)
"""Half the sides of the box."""


def imager(focal: float, **changes) -> Imager:
    K = np.array([[focal, 0, (WIDTH - 1) / 2 + 0.7], [0, focal * 1.01, (HEIGHT - 1) / 2 - 1.3], [0, 0, 1]])
    return Imager(width=WIDTH, height=HEIGHT, K=K, **changes)


def aside() -> CameraDescription:
    """A camera whose colour imager stands 15 mm beside the other, turned a little, with a longer lens."""
    pose = np.eye(4)
    pose[:3, 3] = (0.015, -0.002, 0.001)
    turn = 0.02
    pose[:3, :3] = [[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]]
    return CameraDescription(
        serial="0123", depth=imager(120.0), color=imager(150.0), depth_unit_m=UNIT_M, T_color_depth=pose
    )


def together(serial: str = "0123") -> CameraDescription:
    """A camera with both imagers in one place, whose depth imager has the wider view."""
    return CameraDescription(serial=serial, depth=imager(120.0), color=imager(150.0), depth_unit_m=UNIT_M)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Scene before `body`; `hole`: rows and columns of the depth image without a reading."""

    body: CameraDescription
    hole: tuple[slice, slice] | None = None

    def depth(self) -> np.ndarray:
        image = np.full((HEIGHT, WIDTH), round(PLANE_M / UNIT_M), np.uint16)
        image[self.box_in_depth()] = round(BOX_M / UNIT_M)
        if self.hole is not None:
            image[self.hole] = 0
        return image

    def box_in_depth(self) -> np.ndarray:
        x, y, _ = np.moveaxis(self._rays(self.body.depth) * BOX_M, -1, 0)
        return (np.abs(x) < HALF_M[0]) & (np.abs(y) < HALF_M[1])

    def corners_in_color(self) -> np.ndarray:
        """Corners of the box in the colour image [pixel]: left, right; top, bottom, in that order."""
        signs = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
        corners = np.column_stack([signs * HALF_M, np.full(4, BOX_M)])
        pose = self.body.T_color_depth
        seen = (corners @ pose[:3, :3].T + pose[:3, 3]) @ self.body.color.K.T
        return seen[:, :2] / seen[:, 2:]

    def hole_in_color(self) -> tuple[slice, slice]:
        """Rows and columns of the colour image without depth for certain, with both imagers in one place."""
        assert self.hole is not None
        rows, columns = self.hole
        turn = self.body.color.K @ np.linalg.inv(self.body.depth.K)
        left, top, _ = turn @ [columns.start, rows.start, 1]
        right, bottom, _ = turn @ [columns.stop - 1, rows.stop - 1, 1]
        return slice(round(top) + 1, round(bottom)), slice(round(left) + 1, round(right))

    def color(self, number: int) -> np.ndarray:
        return np.full((HEIGHT, WIDTH, 3), (number % 250, 100, 200), np.uint8)

    def views(self, count: int, *, start_s: float | None = None) -> Iterator[ImagerPair]:
        """`count` views at the camera's rate; the red of each is its number."""
        start_s = time.time() if start_s is None else start_s
        for number in range(count):
            yield ImagerPair(color=self.color(number), depth=self.depth(), stamp_s=start_s + number / RATE_HZ)

    def _rays(self, imager: Imager) -> np.ndarray:
        u, v = np.meshgrid(np.arange(imager.width), np.arange(imager.height))
        return np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(imager.K).T
