"""Fit of a held bowl: a ball of about its radius, moved to the readings of its outer wall, and its rim."""

from collections.abc import Sequence
from typing import Final, TypeAlias

import numpy as np
from jaxtyping import Float64
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from app.core.messages import Frame
from app.core.types import Cloud
from app.perception.reconstruct import Reconstruction
from app.perception.tool_readings import solid_points

Readings: TypeAlias = Float64[np.ndarray, "M 3"]
"""Points [m] from where the kinematics have the bowl's centre."""

BOWL_POINTS: Final = 60
_LEAST_POINTS = 120
"""Fewest readings of the wall for a fit."""
_REACH_M = 0.020
"""Largest distance of the bowl from its place by the kinematics."""
_BELOW_RIM_M = 0.006
"""Readings nearer to the plane of the rim may be of its edge or of the inside."""
_RIM, _RIM_M = 0.95, 0.0005
"""Share of the wall's readings below the rim's height, and standard deviation of what that says."""
_RADIUS_M = 0.001
"""Standard deviation of the radius: half a millimetre of it would move a ball that is seen from above by two."""
_OFF_WALL_M = 0.004
_NOISE_M = 0.0013
_KNOWN_M = 0.0015
"""Standard deviation, with errors of neighbouring readings alike, beyond which the centre is not determined."""
_ALIKE = 25.0
"""Readings that err alike."""
_ROUNDS = 3
_NOTHING: Cloud = np.zeros((0, 3), np.float32)


def bowl_points(
    frames: Sequence[Frame], pose: Float64[np.ndarray, "7"], how: Reconstruction, *, radius_m: float, seed: int = 0
) -> Cloud:
    """60 points [m, world] whose mean is the centre of the bowl as cameras see it; none where too little is seen.

    `pose`: by the kinematics, x y z and a quaternion w x y z of a tool that points down. `radius_m`: of its outer wall.
    As of `tool_points`, the spread of the points is that of the readings.
    """
    # The tool's z axis points down where the bowl is upright.
    axis = -Rotation.from_quat(pose[3:7], scalar_first=True).as_matrix()[:, 2]
    readings = np.concatenate([np.zeros((0, 3)), *(_readings(frame, pose[:3], how, radius_m) for frame in frames)])
    shift = np.zeros(3)
    near = readings
    for _ in range(_ROUNDS):
        wall = _on_wall(readings, shift, radius_m)
        near = wall[(wall - shift) @ axis < -_BELOW_RIM_M]
        if len(near) < _LEAST_POINTS:
            return _NOTHING
        rim_m = float(np.quantile(wall @ axis, _RIM))
        shift, deviation = _fit(near, shift, radius_m, axis, rim_m)
        if deviation > _KNOWN_M or np.linalg.norm(shift) > _REACH_M:
            return _NOTHING
    away = near - shift
    off = away * (1 - radius_m / np.linalg.norm(away, axis=1, keepdims=True))
    spread = np.random.default_rng(seed).permutation(off)[:BOWL_POINTS]
    return (pose[:3] + shift + spread - spread.mean(axis=0)).astype(np.float32)


def _readings(frame: Frame, place: Float64[np.ndarray, "3"], how: Reconstruction, radius_m: float) -> Readings:
    """Readings about the bowl, without those of the object's colour or beside it, and those between surfaces."""
    away = solid_points(frame, how) - place
    reading = away[np.linalg.norm(away, axis=1) < radius_m + _REACH_M]
    # Of a wall between the camera and the bowl's centre, the outer side is seen.
    eye = frame.camera.T_world_camera[:3, 3] - place
    return reading[(reading @ eye) > 0]


def _on_wall(readings: Readings, shift: Float64[np.ndarray, "3"], radius_m: float) -> Float64[np.ndarray, "W 3"]:
    """The readings near the outer wall of a bowl that is displaced by `shift`."""
    off_m = _OFF_WALL_M if shift.any() else _REACH_M
    return readings[np.abs(np.linalg.norm(readings - shift, axis=1) - radius_m) < off_m]


def _fit(
    near: Readings, start: Float64[np.ndarray, "3"], radius_m: float, axis: Float64[np.ndarray, "3"], rim_m: float
) -> tuple[Float64[np.ndarray, "3"], float]:
    """Displacement of the centre [m], and its largest standard deviation in any direction [m].

    `rim_m`: place of the rim along the axis.
    """
    alike = np.sqrt(_ALIKE)

    def residuals(found: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, " R"]:
        shift, larger_m = found[:3], found[3]
        wall = (np.linalg.norm(near - shift, axis=1) - radius_m - larger_m) / (alike * _NOISE_M)
        return np.concatenate([wall, [larger_m / _RADIUS_M, (shift @ axis - rim_m) / _RIM_M]])

    found = least_squares(residuals, np.append(start, 0.0), loss="soft_l1", x_scale=_NOISE_M)
    covariance = np.linalg.inv(found.jac.T @ found.jac)[:3, :3]
    return found.x[:3], float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
