"""Fit of the finger's tip: a capsule fitted to readings of its surface and to its outline.

The surface gives the axis. Its lower end is hardly in the surface, whose lowest part faces away from cameras above the
table; it is in the outline, where pixels of the finger end and pixels of the table behind it begin.
"""

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float64
from scipy.optimize import least_squares
from scipy.special import expit

from app.core.colours import Mask
from app.core.geometry.camera import CameraModel
from app.core.messages import Frame
from app.core.types import Cloud
from app.perception.cloud.depth import behind_an_edge, deproject, project
from app.perception.reconstruct import Reconstruction
from app.perception.tool_readings import without_object

Capsule: TypeAlias = Float64[np.ndarray, "5"]
"""Capsule parameters: its tip x y z [m], and the slopes of its axis along x and y per unit of height."""
Vectors: TypeAlias = Float64[np.ndarray, "M 3"]

TIP_POINTS = 60
_LEAST_POINTS = 60
"""Fewest readings of the finger for a fit."""
_OVER_TABLE_M = 0.005
"""Height over the table that is not table: five standard deviations of a D400's depth at 0.75 m."""
_REACH_M = 0.050
"""Largest distance of the finger from its position by the kinematics: delays, bent arms and camera errors."""
_CLEAR_M, _TOP_M = 0.025, 0.080
"""Heights over the tip between which there is the finger alone, neither object nor hand."""
_OFF_SURFACE_M = 0.004
_NOISE_M = 0.001
_OUTLINE_M = 0.001
"""Sharpness of the finger's outline: a pixel at 0.7 m. Half of it put the tip 0.1 mm higher, and less steadily."""
_DOUBT = 0.5
"""Standard deviation of the class of a pixel on the outline, finger or not."""
_BESIDE_M = 0.015
"""Distance from the capsule beyond which pixels do not inform its outline."""
_KNOWN_M = 0.0015
"""Standard deviation beyond which a tip is not determined: something hides the finger's end."""
_NEAR_TABLE_M = 0.020
_AROUND_M = 0.150
"""Extent about the tip of the table behind the finger's lower part, as cameras above see it."""
_SCALE = np.array([0.001, 0.001, 0.001, 0.01, 0.01])
"""Scale of the search: millimetres, and a millimetre over a decimetre."""
_HABITS = np.array([0.01, 0.1, 0.1])
"""Prior standard deviations of the tip's height [m] and of the axis from the vertical, for directions without data."""
_NOTHING: Cloud = np.zeros((0, 3), np.float32)


def tool_points(
    frames: Sequence[Frame],
    tip: Float64[np.ndarray, "3"],
    how: Reconstruction,
    *,
    radius_m: float,
    seed: int = 0,
) -> Cloud:
    """60 points [m, world] whose mean is the finger's tip as the cameras see it; none where its end is hidden.

    The finger is a capsule of `radius_m` that hangs down, its tip the lowest point on its axis. Tip and tilt are fitted
    to the readings near `tip` [m], its position by the kinematics, without those of the object's colour or as low over
    the table as depth errs. Each point is the tip shifted by the distance of one reading from the fitted surface: their
    spread is that of the readings. Frames taken at different times of a motion give a tip between them.
    """
    looks = [_look(frame, tip, how) for frame in frames]
    looks = [look for look in looks if len(look.upper) >= _LEAST_POINTS]
    if not looks:
        return _NOTHING
    surface = np.concatenate([look.upper for look in looks])
    middle = np.mean([_middle(look, radius_m) for look in looks], axis=0)
    fit, _ = _fit(np.array([*middle, tip[2], 0.0, 0.0]), tip[2], surface, [], radius_m)
    surface = surface[np.linalg.norm(_off_surface(fit, surface, radius_m), axis=1) < _OFF_SURFACE_M]
    outlines = [_outline(look, fit, radius_m) for look in looks]
    fit, deviation = _fit(fit, tip[2], surface, outlines, radius_m)
    if len(surface) < _LEAST_POINTS or deviation[:3].max() > _KNOWN_M:
        return _NOTHING
    spread = np.random.default_rng(seed).permutation(_off_surface(fit, surface, radius_m))[:TIP_POINTS]
    return (fit[:3] + spread - spread.mean(axis=0)).astype(np.float32)


class _Look(NamedTuple):
    """View of the finger from a camera at `eye`: points on it, its upper ones alone, and points on the table."""

    eye: Float64[np.ndarray, "3"]
    finger: Vectors
    upper: Vectors
    behind: Vectors


def _look(frame: Frame, tip: Float64[np.ndarray, "3"], how: Reconstruction) -> _Look:
    """The view, without pixels beside the object's, which may be of either, and those between finger and table."""
    camera = frame.camera
    between = behind_an_edge(frame.depth, how.edge_step_m, camera)
    wanted = _window(camera, tip, how) & without_object(frame, how)
    solid, doubtful = (deproject(frame.depth, wanted & part, camera).astype(np.float64) for part in (~between, between))
    solid, doubtful = (points[_beside(points, tip, _AROUND_M)] for points in (solid, doubtful))
    over = _table_m(solid, how) + _OVER_TABLE_M
    finger = solid[_beside(solid, tip, _REACH_M) & (solid[:, 2] > over) & (solid[:, 2] < tip[2] + _TOP_M)]
    behind = np.concatenate([points[points[:, 2] < over] for points in (solid, doubtful)])
    upper = finger[finger[:, 2] > tip[2] + _CLEAR_M]
    return _Look(camera.T_world_camera[:3, 3], finger, upper, behind)


def _window(camera: CameraModel, tip: Float64[np.ndarray, "3"], how: Reconstruction) -> Mask:
    """Mask of the pixels that can show the finger or the table around it: the others need no deprojection."""
    sides = [(tip[axis] - _AROUND_M, tip[axis] + _AROUND_M) for axis in range(2)]
    corners = np.array(list(product(*sides, (how.table_m, tip[2] + _TOP_M))), np.float32)
    column, row, _ = np.nan_to_num(project(corners, camera)).T
    mask = np.zeros((camera.height, camera.width), bool)
    low, high = (
        np.maximum([row.min(), column.min()], 0).astype(int),
        np.maximum([row.max(), column.max()], 0).astype(int),
    )
    mask[low[0] : high[0] + 1, low[1] : high[1] + 1] = True
    return mask


def _middle(look: _Look, radius_m: float) -> Float64[np.ndarray, "2"]:
    """Approximate position of the axis: behind the side that the camera sees."""
    seen = np.median(look.upper[:, :2], axis=0)
    ahead = seen - look.eye[:2]
    return seen + radius_m * ahead / np.linalg.norm(ahead)


def _beside(points: Vectors, tip: Float64[np.ndarray, "3"], within_m: float) -> Bool[np.ndarray, " M"]:
    return np.linalg.norm(points[:, :2] - tip[:2], axis=1) < within_m


def _table_m(points: Vectors, how: Reconstruction) -> float:
    """Apparent height of the table here, which a camera error shifts."""
    low = points[np.abs(points[:, 2] - how.table_m) < _NEAR_TABLE_M, 2]
    return float(np.median(low)) if len(low) else how.table_m


class _Outline(NamedTuple):
    """Rays from an eye to readings, with the mask of those on the finger."""

    eye: Float64[np.ndarray, "3"]
    rays: Vectors
    is_finger: Bool[np.ndarray, " M"]


def _outline(look: _Look, capsule: Capsule, radius_m: float) -> _Outline:
    """The pixels about the capsule's outline."""
    rays = np.concatenate([look.finger, look.behind]) - look.eye
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    is_finger = np.arange(len(rays)) < len(look.finger)
    near = np.abs(_clearance(capsule, look.eye, rays, radius_m)) < _BESIDE_M
    return _Outline(look.eye, rays[near], is_finger[near])


def _fit(
    start: Capsule, height_m: float, surface: Vectors, outlines: Sequence[_Outline], radius_m: float
) -> tuple[Capsule, Float64[np.ndarray, "5"]]:
    """The best fit of the capsule to readings of its surface and to its outlines, and its standard deviations.

    Outliers count little (soft L1). `height_m`: prior height of the tip; the axis is nearly vertical.
    """

    def residuals(capsule: Capsule) -> Float64[np.ndarray, " R"]:
        parts = [(_from_axis(capsule, surface, radius_m)[1] - radius_m) / _NOISE_M]
        for eye, rays, is_finger in outlines:
            parts.append((is_finger - expit(-_clearance(capsule, eye, rays, radius_m) / _OUTLINE_M)) / _DOUBT)
        parts.append(np.array([capsule[2] - height_m, *capsule[3:]]) / _HABITS)
        return np.concatenate(parts)

    found = least_squares(residuals, start, loss="soft_l1", x_scale=_SCALE)
    return found.x, np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))


def _off_surface(capsule: Capsule, points: Vectors, radius_m: float) -> Vectors:
    """Vectors from the nearest point of the capsule's surface to each point."""
    out, distance = _from_axis(capsule, points, radius_m)
    return out * (1 - radius_m / np.maximum(distance, np.finfo(float).tiny))[:, None]


def _from_axis(capsule: Capsule, points: Vectors, radius_m: float) -> tuple[Vectors, Float64[np.ndarray, " M"]]:
    """Vectors and distances from the capsule's axis, which ends a radius above its tip, to each point."""
    end, up = _axis(capsule, radius_m)
    from_end = points - end
    out = from_end - np.maximum(from_end @ up, 0.0)[:, None] * up
    return out, np.linalg.norm(out, axis=1)


def _clearance(
    capsule: Capsule, eye: Float64[np.ndarray, "3"], rays: Vectors, radius_m: float
) -> Float64[np.ndarray, " M"]:
    """Signed distance of each ray from the capsule [m]; negative where it hits."""
    end, up = _axis(capsule, radius_m)
    to_end, slant = end - eye, rays @ up
    along = np.maximum((slant * (rays @ to_end) - up @ to_end) / (1 - slant**2), 0.0)
    nearest = to_end + along[:, None] * up
    return np.linalg.norm(np.cross(nearest, rays), axis=1) - radius_m


def _axis(capsule: Capsule, radius_m: float) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
    """Lower end of the capsule's axis, a radius above its tip, and its direction."""
    up = np.array([capsule[3], capsule[4], 1.0])
    up /= np.linalg.norm(up)
    return capsule[:3] + radius_m * up, up
