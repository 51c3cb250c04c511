"""A ChArUco board in the simulated gripper, painted into the images, for trials of camera calibration."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final, final

import cv2
import numpy as np
from jaxtyping import Float64, UInt8
from scipy.spatial.transform import Rotation

from app.core.geometry.camera import CameraModel
from app.core.geometry.charuco import DICTIONARIES, MARKERS, Charuco
from app.core.types import ColourImage, DepthImage, ToolPose, Transform

_A4: Final = Charuco()
_FINE: Final = 2
"""Rays per pixel in each direction."""
_TEXTURE_PX_M: Final = 2500.0
_DARK, _LIGHT, _NOISE = 30.0, 190.0, 2.0
"""Grey levels of ink, of paper, and of the camera's noise."""
_IN_FRONT_M: Final = 0.004
"""Difference in depth by which a nearer surface hides the board: two standard deviations of the depth."""


@final
@dataclass(frozen=True, kw_only=True)
class HeldBoard:
    """A board in the gripper, level and with its pattern up where the tool points down, its middle beside the fingers.

    `middle_m`: in the tool's frame, whose z points along the fingers.
    """

    board: Charuco = _A4
    middle_m: tuple[float, float, float] = (0.16, 0.0, -0.03)

    def at(self, tool: ToolPose) -> Transform:
        """`T_world_board` for this tool pose."""
        T_world_tool, T_tool_board = np.eye(4), np.eye(4)
        T_world_tool[:3, :3] = Rotation.from_quat(tool[3:7], scalar_first=True).as_matrix()
        T_world_tool[:3, 3] = tool[:3]
        width, height = self.board.size_m
        T_tool_board[:3, 3] = np.array(self.middle_m) - [width / 2, height / 2, 0.0]
        return T_world_tool @ T_tool_board


def paint(
    held: HeldBoard,
    tool: ToolPose,
    camera: CameraModel,
    color: ColourImage,
    depth: DepthImage,
    rng: np.random.Generator,
) -> tuple[ColourImage, DepthImage]:
    """The images with the board in them, hidden by nearer surfaces; its back is white."""
    T_camera_board = np.linalg.inv(camera.T_world_camera) @ held.at(tool)
    outline = held.board.outline() @ T_camera_board[:3, :3].T + T_camera_board[:3, 3]
    if np.any(outline[:, 2] < _IN_FRONT_M):
        return color, depth
    drawn, covers = _draw_board(held.board, T_camera_board, camera)
    z = _depth(T_camera_board, camera)
    behind = (depth == 0) | (depth * camera.depth_unit_m > z - _IN_FRONT_M)
    shown = covers & behind
    color, depth = color.copy(), depth.copy()
    noisy = drawn[shown] + _NOISE * rng.standard_normal(int(shown.sum()))
    color[shown] = np.clip(noisy, 0, 255).astype(np.uint8)[:, None]
    depth[shown] = np.rint(z[shown] / camera.depth_unit_m).astype(np.uint16)
    return color, depth


@lru_cache(maxsize=2)
def _texture(board: Charuco) -> UInt8[np.ndarray, "h w"]:
    cells = DICTIONARIES[board.dictionary]
    markers = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{cells}X{cells}_{MARKERS}"))
    made = cv2.aruco.CharucoBoard((board.columns, board.rows), board.square_m, board.marker_m, markers)
    width, height = (round(side * _TEXTURE_PX_M) for side in board.size_m)
    return np.asarray(made.generateImage((width, height)), np.uint8)


def _draw_board(
    board: Charuco, T_camera_board: Transform, camera: CameraModel
) -> tuple[Float64[np.ndarray, "h w"], np.ndarray]:
    """Grey levels, and the mask of the pixels that the board covers wholly."""
    plane = np.diag([1 / _TEXTURE_PX_M, 1 / _TEXTURE_PX_M, 1.0])
    plane[:2, 2] = 0.5 / _TEXTURE_PX_M  # A pixel of the texture has its centre half a pixel inside.
    fine = np.array([[_FINE, 0, (_FINE - 1) / 2], [0, _FINE, (_FINE - 1) / 2], [0, 0, 1.0]])
    to_image = fine @ camera.K @ T_camera_board[:3, [0, 1, 3]] @ plane
    texture = _texture(board)
    facing = T_camera_board[:3, 2] @ T_camera_board[:3, 3] > 0
    ink = texture if facing else np.full_like(texture, 255)
    large, small = (camera.width * _FINE, camera.height * _FINE), (camera.width, camera.height)
    sharp, there = (cv2.warpPerspective(each, to_image, large) for each in (ink, np.full_like(texture, 255)))
    grey, share = (cv2.resize(each, small, interpolation=cv2.INTER_AREA).astype(float) for each in (sharp, there))
    return _DARK + (_LIGHT - _DARK) / 255 * grey, share > 250


def _depth(T_camera_board: Transform, camera: CameraModel) -> Float64[np.ndarray, "h w"]:
    """Depth of the board's plane along each pixel's ray [m]; infinite where it is not in front of the camera."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(camera.K).T
    normal = T_camera_board[:3, 2]
    toward = rays @ normal
    z = (normal @ T_camera_board[:3, 3]) / np.where(np.abs(toward) < np.finfo(float).eps, np.nan, toward)
    return np.where(np.isfinite(z) & (z > 0), z, np.inf)
