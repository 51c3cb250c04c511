"""Fit of a paddle: an upright box of known size and turn, moved to the readings of its surface."""

from collections.abc import Sequence
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float64
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from app.core.messages import Frame
from app.core.types import Cloud, Path3
from app.perception.reconstruct import Reconstruction
from app.perception.tool_readings import solid_points

Inside: TypeAlias = Float64[np.ndarray, "M 3"]
"""Points in the frame of the paddle where the kinematics have it [m]: across, along its thickness, up."""

PADDLE_POINTS: Final = 60
_LEAST_POINTS = 60
"""Fewest readings of the paddle for a fit."""
_REACH_M = 0.050
"""Largest distance of the paddle from its position by the kinematics: delays, bent arms and camera errors."""
_LOW_M, _OVER_M = 0.022, 0.012
"""Heights of the readings used: over two beans that lie on each other, and up to a little over the paddle's top."""
_HANDLE_M = 0.030
"""Half the width of the part of the paddle over which its handle is, wherever it truly is."""
_TOP_M, _TOP_SHARE = 0.003, 0.9
"""Readings so far over the top are of the handle; the top is the height of this share of those beside it."""
_EDGES = 0.02, 0.98
"""Shares of the readings across the paddle between which is its middle."""
_WIDE = 0.15
"""Largest deviation of the width between them from the paddle's: else something hides one of its ends."""
_OFF_SURFACE_M = 0.004
_NOISE_M = 0.001
_KNOWN_M = 0.0015
"""Standard deviation beyond which the paddle's place is not determined."""
_PRIOR_M = 0.010
"""Prior standard deviation of its displacement, for directions without data."""
_NOTHING: Cloud = np.zeros((0, 3), np.float32)


class _Box(NamedTuple):
    """The paddle by the kinematics: its middle [m], its turn, and half its sides [m]."""

    middle: Float64[np.ndarray, "3"]
    turn: Rotation
    half_m: Float64[np.ndarray, "3"]


def paddle_points(
    frames: Sequence[Frame],
    pose: Float64[np.ndarray, "7"],
    how: Reconstruction,
    *,
    half_m: tuple[float, float, float],
    seed: int = 0,
) -> Cloud:
    """60 points [m, world] whose mean is the paddle's middle as the cameras see it; none where too little is seen.

    `pose`: by the kinematics, x y z and a quaternion w x y z of a tool that points down. `half_m`: half its sides, as
    `Paddle` has them. As of `tool_points`, the spread of the points is that of the readings.
    """
    box = _Box(pose[:3], Rotation.from_quat(pose[3:7], scalar_first=True), np.array(half_m))
    points = np.concatenate([np.zeros((0, 3)), *(_readings(frame, box, how) for frame in frames)])
    points = points[_below_handle(points, box)]
    if len(points) < _LEAST_POINTS:
        return _NOTHING
    shift, _ = _fit(points, box)
    points = points[np.abs(_distances(points - shift, box)) < _OFF_SURFACE_M]
    if len(points) < _LEAST_POINTS or not _is_wide(points, box):
        return _NOTHING
    shift, deviation = _fit(points, box)
    off = _off_surface(points - shift, box)
    if deviation.max() > _KNOWN_M or np.abs(shift).max() > _REACH_M:
        return _NOTHING
    spread = np.random.default_rng(seed).permutation(off)[:PADDLE_POINTS]
    return (box.middle + box.turn.apply(_down(shift + spread - spread.mean(axis=0)))).astype(np.float32)


def gripper_points(
    frames: Sequence[Frame],
    pose: Float64[np.ndarray, "8"],
    how: Reconstruction,
    *,
    half_m: tuple[float, float, float],
) -> Cloud:
    """As `paddle_points`, of a closed gripper, whose fingers together are such a box; their mean is between its tips.

    `pose` ends with the opening [m]; `half_m`: half sides of a finger, as `Gripper` has them.
    """
    across, thick, tall = half_m
    up = np.array([0.0, 0.0, tall])
    middle = np.concatenate([pose[:3] + up, pose[3:7]])
    found = paddle_points(frames, middle, how, half_m=(across, 2 * thick + float(pose[7]) / 2, tall))
    return (found - up).astype(np.float32)


def _readings(frame: Frame, box: _Box, how: Reconstruction) -> Inside:
    """Readings about the paddle, without those of the object's colour or beside it, and those between surfaces."""
    points = solid_points(frame, how)
    reach = box.half_m[:2] + _REACH_M
    near = np.linalg.norm(points[:, :2] - box.middle[:2], axis=1) < np.linalg.norm(reach)
    points = points[near & (points[:, 2] > how.table_m + _LOW_M)]
    inside = _down(box.turn.inv().apply(points - box.middle))
    return inside[(np.abs(inside[:, :2]) < reach).all(1) & (inside[:, 2] < box.half_m[2] + _OVER_M)]


def _down(points: Path3) -> Path3:
    """Points from the tool's frame, whose z axis points down, to the paddle's, or back."""
    return points * [1.0, -1.0, -1.0]


def _below_handle(points: Inside, box: _Box) -> Bool[np.ndarray, " M"]:
    """Mask of the readings that are not over the paddle's top, which is seen beside its handle."""
    beside = points[np.abs(points[:, 0]) > _HANDLE_M, 2]
    top = np.quantile(beside, _TOP_SHARE) if len(beside) else box.half_m[2]
    return points[:, 2] < top + _TOP_M


def _is_wide(points: Inside, box: _Box) -> bool:
    """True where both ends of the paddle are seen."""
    low, high = np.quantile(points[:, 0], _EDGES)
    return bool(abs((high - low) / (2 * box.half_m[0]) - 1) < _WIDE)


def _fit(points: Inside, box: _Box) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "2"]]:
    """Displacement of the box that fits best [m], and the standard deviation of its parts in thickness and height.

    Readings on its faces do not say where it is across them; the middle between both of its ends does.
    """
    low, high = np.quantile(points[:, 0], _EDGES)
    across = (low + high) / 2
    within = points[np.abs(points[:, 0] - across) < box.half_m[0]]

    def residuals(shift: Float64[np.ndarray, "2"]) -> Float64[np.ndarray, " R"]:
        moved = within - np.array([across, *shift])
        return np.concatenate([_distances(moved, box) / _NOISE_M, shift / _PRIOR_M])

    start = np.array([np.median(points[:, 1]), 0.0])
    found = least_squares(residuals, start, loss="soft_l1", x_scale=_NOISE_M)
    deviation = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    return np.array([across, *found.x]), deviation


def _distances(points: Inside, box: _Box) -> Float64[np.ndarray, " M"]:
    """Distances of points from the box's surface [m], negative inside it."""
    beyond = np.abs(points) - box.half_m
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)


def _off_surface(points: Inside, box: _Box) -> Inside:
    """Vectors from the nearest point of the box's surface to each point."""
    beyond = np.abs(points) - box.half_m
    outside = np.sign(points) * np.maximum(beyond, 0.0)
    nearest = np.arange(3) == beyond.argmax(1)[:, None]
    return np.where(beyond.max(1)[:, None] > 0, outside, np.sign(points) * np.where(nearest, beyond, 0.0))
