"""Motion of occluded parts of the object: the tool pushes them ahead of itself.

Geometry alone, over the last step only: points inside the tool's outline move in the tool's direction until they are
outside, and the points within the object's own width of them move along. The bending of a rope farther away and the
rolling of beans are not modelled; `dipac bench unseen_pushes` measures the gain all the same.
"""

from itertools import pairwise

import numpy as np
from jaxtyping import Float32, Float64
from scipy.spatial.transform import Rotation

from app.core.geometry.scene_description import Finger, Gripper, HeldBowl, Paddle, Tool
from app.core.types import ToolPath, ToolPose

_STEP_M = 0.003
"""Step of the tool: less than half a paddle's thickness, so that it passes through nothing."""
_STILL_M = 1e-6

Surface = Float32[np.ndarray, "R 3"]
Plan = Float64[np.ndarray, "P 2"]
"""Points seen from above [m]."""


def carry_along(points: Surface, tool: Tool, way: ToolPath, width_m: float) -> Surface:
    """Positions [m, world] of `points` of an object of this width after the tool's path; unchanged without contact.

    A gripper and a bowl hold, and do not push.
    """
    if isinstance(tool, (Gripper, HeldBowl)):
        return points
    moved = points.astype(np.float64)
    for begin, end in pairwise(way):
        count = int(np.ceil(np.linalg.norm(end[:2] - begin[:2]) / _STEP_M))
        for share in np.arange(1, count + 1) / max(count, 1):
            at = begin + share * (end - begin)
            _push(moved, tool, at, end[:2] - begin[:2], width_m)
    return moved.astype(np.float32)


def _push(points: Float64[np.ndarray, "R 3"], tool: Tool, at: ToolPose, ahead: np.ndarray, width_m: float) -> None:
    """Move the `points` in direction `ahead` out of the tool at its pose, with the points near them."""
    length_m = np.linalg.norm(ahead)
    if length_m < _STILL_M:
        return
    ahead = ahead / length_m
    away = points[:, :2] - at[:2]
    extent_m = _extent(tool)
    beside = (np.linalg.norm(away, axis=1) < extent_m + width_m) & (points[:, 2] > _bottom(tool, at))
    beside = np.flatnonzero(beside)
    deep = _exit(tool, at, away[beside], ahead)
    inside = deep > 0
    if not inside.any():
        return
    # Points behind the tool stay there.
    front = beside[away[beside] @ ahead > -_thickness(tool, at, ahead)]
    gaps = np.linalg.norm(points[front, None, :2] - points[beside[inside], :2], axis=2)
    points[front, :2] += np.where(gaps < width_m, deep[inside], 0.0).max(axis=1)[:, None] * ahead


def _exit(tool: Tool, at: ToolPose, away: Plan, ahead: np.ndarray) -> Float64[np.ndarray, " P"]:
    """Distance of points, relative to the tool, to the edge of its outline in direction `ahead`; 0 outside."""
    match tool:
        case Finger():
            return _exit_stadium(away, ahead, np.asarray(tool.half_m), tool.radius_m)
        case Paddle():
            axes, half_m = _axes(at), np.asarray(tool.half_m[:2])
            place, way = away @ axes.T, axes @ ahead
            inside = np.all(np.abs(place) < half_m, axis=1)
            speed = np.maximum(np.abs(way), np.finfo(float).eps)
            return np.where(inside, ((half_m - np.sign(way) * place) / speed).min(axis=1), 0.0)
        case _:
            return np.zeros(len(away))


def _exit_stadium(away: Plan, ahead: np.ndarray, half_m: np.ndarray, radius_m: float) -> Float64[np.ndarray, " P"]:
    """The same for the outline within a radius of the line from `-half_m` to `half_m`: two discs and a rectangle."""
    aside, width_m = np.array([-ahead[1], ahead[0]]), np.linalg.norm(half_m)
    along, across = away @ ahead, away @ aside
    chords = [radius_m**2 - (across - end @ aside) ** 2 for end in (-half_m, half_m)]
    leaves = [
        np.where(chord > 0, end @ ahead + np.sqrt(np.maximum(chord, 0.0)), -np.inf)
        for chord, end in zip(chords, (-half_m, half_m), strict=True)
    ]
    place = np.zeros(len(away))
    if width_m > _STILL_M:
        place = np.clip(away @ half_m / width_m**2, -1.0, 1.0)
        axes = np.array([half_m, [-half_m[1], half_m[0]]]) / width_m
        sides, way = np.array([width_m, radius_m]), axes @ ahead
        sign, speed = np.where(way < 0, -1.0, 1.0), np.maximum(np.abs(way), np.finfo(float).eps)
        ahead_m = ((sides - sign * (away @ axes.T)) / speed).min(axis=1)
        behind_m = ((-sides - sign * (away @ axes.T)) / speed).max(axis=1)
        leaves.append(np.where(ahead_m > behind_m, along + ahead_m, -np.inf))
    inside = np.linalg.norm(away - place[:, None] * half_m, axis=1) < radius_m
    return np.where(inside, np.max(leaves, axis=0) - along, 0.0)


def _axes(at: ToolPose) -> Float64[np.ndarray, "2 2"]:
    """The tool's own x and y axes, seen from above."""
    return Rotation.from_quat(at[3:7], scalar_first=True).as_matrix()[:2, :2].T


def _extent(tool: Tool) -> float:
    """Distance from the tool's middle to its farthest corner, seen from above [m]."""
    match tool:
        case Finger():
            return tool.radius_m + tool.half_width_m
        case Paddle():
            return float(np.hypot(*tool.half_m[:2]))
        case _:
            return 0.0


def _thickness(tool: Tool, at: ToolPose, ahead: np.ndarray) -> float:
    """Distance from the tool's middle to its back in the direction of motion [m]."""
    if isinstance(tool, Finger):
        return tool.radius_m + float(abs(np.asarray(tool.half_m) @ ahead))
    return float(np.abs(_axes(at) @ ahead) @ tool.half_m[:2]) if isinstance(tool, Paddle) else _extent(tool)


def _bottom(tool: Tool, at: ToolPose) -> float:
    """Height of its lowest part [m]; lower points are not touched."""
    return float(at[2] - tool.half_m[2]) if isinstance(tool, Paddle) else float(at[2])
