"""Displacement field of an object from its prediction to its observation: smooth modes along or over it.

Of a rod the field is that of its centreline (`centreline_gap`); of what else there is, clouds are registered.
Points have no names, so they cannot be subtracted; and matches to the nearest neighbour, frozen, lose most of an
effect. The predicted cloud is moved instead, by a few smooth modes, until the kernel mean embeddings of both agree,
phi_c(P) = mean_i exp(-|x_i - c|^2 / 2 h^2) on a lattice of centres c, h about the object's width (Smola et al. 2007, "A
Hilbert space embedding for distributions"; non-rigid registration by smooth fields as in Myronenko and Song 2010,
"Point set registration: coherent point drift"). What that takes is the residual, in metres. Predictions of two models
have the same particles, and their difference is projected onto the same modes exactly.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float32, Float64
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from app.core.types import Points
from app.sim.effects.base import MIDDLE_M

MODES = 8
"""Cosines along the object, the constant included; each across and along it. Amplitudes: 2 MODES a view."""
AFTER = slice(2 * MODES, 4 * MODES)
"""Rows of the residuals of a view after a push; those of the one during it come first."""
PIECE_MODES = 12
"""Amplitudes a view of loose pieces."""
SHEET_MODES = 12
"""Amplitudes a view of a cloth, in space."""
REVERSED = np.tile(-((-1.0) ** np.arange(MODES)), 4)
"""Sign of each row of both views where the object's other end is called the first: across and along turn round, and so
do odd cosines."""
WIDTH_M = 0.015
"""h, about the width of the ropes and beans on the table; and the lattice's spacing."""
_WIDTHS_M = (0.03, WIDTH_M)
"""Kernel widths: the first finds matter that is more than a width away."""
_SHEET_WIDTHS_M = (0.06, 0.03)
"""The same of a cloth in the air, whose folds are narrower than what predicts them resolves."""
_REACH_M = 0.03
_PRIOR_M = np.concatenate([np.full(MODES, 0.03), [0.03], np.full(MODES - 1, 0.002)])
"""Prior standard deviation of each mode, which keeps those that a view does not determine at zero. Ropes do not
stretch: along them, all modes but the first are strain, and an uneven density would be taken for it."""
_FIELD_M, _NEAR_M = 0.2, 0.06
"""Unit of place of the field over all pieces, and of that about the tool: a paddle's half width and a bean."""
_PIECES_PRIOR_M = np.array([0.02, 0.005, 0.005] * 2 + [0.03, 0.02, 0.02] * 2)
_SHEET_M = 0.1
"""Unit of place of the field over a cloth, less than half of its side."""
_SHEET_PRIOR_M = np.tile([0.03, 0.02, 0.02, 0.02], 3)
_SHEET_POINTS = 30
"""Number of points of a cloth that are displaced independently."""
_POINT_NOISE_M = 2e-3
_DRAWN = 0.3
"""Randomness of the points' spread: 0 is even, 1 is drawn at random (embedding covariances of both kinds)."""
_FLOOR = 1e-7
_ROUNDS = 5
_LARGEST_STEP_M = 0.01
_SMOOTHING = 0.06
"""Share of the object's length over which its direction is averaged."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Basis:
    """Displacements (N, Q, D) of a cloud's points by a unit of each mode, and the modes' prior deviations [m].

    D: 2 on the table, 3 in space. `widths_m`: of kernels. `is_held`: the prior counts in `project`, too, where a mode
    may be one that the cloud does not determine, as a stretch across a flat cloth.
    """

    vectors: Float64[np.ndarray, "N Q D"]
    prior_m: Float64[np.ndarray, " Q"]
    widths_m: tuple[float, float] = _WIDTHS_M
    is_held: bool = False

    @classmethod
    def along(cls, cloud: Points, place: Float32[np.ndarray, " N"]) -> "Basis":
        """Basis for points at `place` (-1 to 1) along an object: 2 MODES, first across, then along it."""
        tangents = _directions(cloud[:, :2].astype(np.float64), place.astype(np.float64))
        normals = np.stack([-tangents[:, 1], tangents[:, 0]], axis=1)
        order = np.arange(MODES)
        shapes = np.cos(np.pi / 2 * order * (place[:, None] + 1)) * np.where(order == 0, 1.0, np.sqrt(2.0))
        across, forth = shapes[:, :, None] * normals[:, None], shapes[:, :, None] * tangents[:, None]
        return cls(vectors=np.concatenate([across, forth], axis=1), prior_m=_PRIOR_M)

    @classmethod
    def around(cls, cloud: Points, tool: Float64[np.ndarray, "4"]) -> "Basis":
        """Basis for loose pieces on a table: `PIECE_MODES`.

        An affine field over all of them, as errors of cameras make it, along x and y; and one that dies out about the
        tool, as errors of what it pushed do, ahead of it and across. `tool`: x and y of its middle [m], and the unit
        vector along which it goes.
        """
        x, ahead = cloud[:, :2].astype(np.float64), tool[2:]
        turned = np.stack([ahead, [-ahead[1], ahead[0]]])
        about, near = (x - MIDDLE_M) / _FIELD_M, (x - tool[:2]) @ turned.T / _NEAR_M
        everywhere = np.concatenate([np.ones((len(x), 1)), about], axis=1)
        window = np.exp(-(near**2).sum(1, keepdims=True) / 2)
        nearby = window * np.concatenate([np.ones((len(x), 1)), near], axis=1)
        fields = ((everywhere, np.eye(2)), (nearby, turned))
        vectors = np.concatenate([shapes[:, :, None] * axis for shapes, axes in fields for axis in axes], axis=1)
        return cls(vectors=vectors, prior_m=_PIECES_PRIOR_M)

    @classmethod
    def over(cls, cloud: Points) -> "Basis":
        """Basis for a cloth in the air: `SHEET_MODES`, an affine field about the cloud's middle along x, y and z."""
        about = (cloud.astype(np.float64) - cloud.mean(0, dtype=np.float64)) / _SHEET_M
        shapes = np.concatenate([np.ones((len(about), 1)), about], axis=1)
        vectors = np.concatenate([shapes[:, :, None] * axis for axis in np.eye(3)], axis=1)
        return cls(vectors=vectors, prior_m=_SHEET_PRIOR_M, widths_m=_SHEET_WIDTHS_M, is_held=True)

    def field(self, amplitudes: Float64[np.ndarray, " Q"]) -> Float64[np.ndarray, "N D"]:
        """The displacement of each point [m]."""
        return np.einsum("nqd,q->nd", self.vectors, amplitudes)

    def project(self, displacement: Float64[np.ndarray, "*batch N D"]) -> Float64[np.ndarray, "*batch Q"]:
        """The amplitudes [m] of displacements of these same points, by least squares."""
        flat = self.vectors.transpose(0, 2, 1).reshape(-1, self.vectors.shape[1])
        rows = displacement.reshape(-1, flat.shape[0])
        if self.is_held:
            noise_m = _POINT_NOISE_M * np.sqrt(len(self.vectors) / _SHEET_POINTS)
            flat = np.concatenate([flat, np.diag(noise_m / self.prior_m)])
            rows = np.concatenate([rows, np.zeros((len(rows), len(self.prior_m)))], axis=1)
        return np.linalg.lstsq(flat, rows.T, rcond=None)[0].T.reshape(*displacement.shape[:-2], -1)


def register(predicted: Points, observed: Points, basis: Basis) -> Float64[np.ndarray, " Q"]:
    """The amplitudes [m] that move the predicted cloud onto the observed one."""
    _, count, axes = basis.vectors.shape
    x, y = predicted[:, :axes].astype(np.float64), observed[:, :axes].astype(np.float64)
    vectors = [(slice(axis, axis + 1), basis.vectors[:, :, axis]) for axis in range(axes)]
    amplitudes = np.zeros(count)
    if basis.is_held:
        amplitudes[:: count // axes] = y.mean(0) - x.mean(0)
    for width in basis.widths_m:
        centres = _lattice(np.concatenate([x, y]), width)
        target = _kernel(y, centres, width).mean(1)
        root = np.linalg.inv(np.linalg.cholesky(_covariance(y, centres, width)))
        for _ in range(_ROUNDS):
            here = x + basis.field(amplitudes)
            k = _kernel(here, centres, width) / len(here)
            # The slope of sum_n k_n by a mode is sum_n k_n (c - x_n) . v_n / h^2.
            along = sum(here[:, axis] * vector for axis, vector in vectors)
            slope = (sum(centres[:, axis] * (k @ vector) for axis, vector in vectors) - k @ along) / width**2
            W, r = root @ slope, root @ (target - k.sum(1))
            normal = W.T @ W + np.diag(1 / basis.prior_m**2)
            step = np.linalg.solve(normal, W.T @ r - amplitudes / basis.prior_m**2)
            longest = float(np.abs(step).max())
            amplitudes = amplitudes + step * min(1.0, _LARGEST_STEP_M / max(longest, 1e-12))
            if longest < 2e-5:
                break
    return amplitudes


def _kernel(
    x: Float64[np.ndarray, "N D"], centres: Float64[np.ndarray, "C D"], width: float
) -> Float64[np.ndarray, "C N"]:
    return np.exp(-cdist(centres, x, "sqeuclidean") / (2 * width**2))


def _covariance(
    x: Float64[np.ndarray, "N D"], centres: Float64[np.ndarray, "C D"], width: float
) -> Float64[np.ndarray, "C C"]:
    """Covariance of the embedding of a cloud with noise, whose points might lie elsewhere in the object."""
    k = _kernel(x, centres, width)
    covariance = _FLOOR * np.eye(len(centres))
    for axis in range(x.shape[1]):
        D = k * (centres[:, None, axis] - x[None, :, axis]) / (width**2 * len(x))
        covariance += _POINT_NOISE_M**2 * D @ D.T
    mean = k.mean(1)
    return covariance + _DRAWN**2 * (k @ k.T / len(x) ** 2 - np.outer(mean, mean) / len(x))


def _lattice(x: Float64[np.ndarray, "M D"], width: float) -> Float64[np.ndarray, "C D"]:
    low, high = x.min(0) - _REACH_M, x.max(0) + _REACH_M
    axes = [np.arange(np.floor(a / width), np.ceil(b / width) + 1) * width for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, x.shape[1])
    return grid[np.asarray(KDTree(x).query(grid)[0]) < 1.5 * width]


def _directions(x: Float64[np.ndarray, "N 2"], place: Float64[np.ndarray, " N"]) -> Float64[np.ndarray, "N 2"]:
    """Unit vectors along the object, smoothed."""
    nodes = np.linspace(-1, 1, int(2 / _SMOOTHING))
    weights = np.exp(-0.5 * ((place[None] - nodes[:, None]) / _SMOOTHING) ** 2)
    middle = weights @ x / weights.sum(1, keepdims=True)
    along = np.gradient(middle, axis=0)
    at = np.stack([np.interp(place, nodes, along[:, axis]) for axis in range(2)], axis=1)
    return at / np.maximum(np.linalg.norm(at, axis=1, keepdims=True), 1e-9)
