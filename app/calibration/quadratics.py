"""Quadratic fits to the losses about an estimate, one a transition, and the uncertainty of their minimum.

A Chamfer distance has a floor, and its nearest neighbours change with every step: its curvature at a point is not
informative, but a quadratic through many points about it is.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64

_FLAT_M2 = 1e-9
"""Least curvature that counts: half of it is the loss [m^2] that a step of one unit would cost on the average."""
_STEEPEST = 5.0
"""Largest length of a gradient, in medians, that keeps its full weight."""
_WEAKEST, _REACH = 0.02, 0.5
"""Least ratio of the smallest to the largest curvature, below which it is not distinguishable from zero; and
standard deviation of points spread to both sides of the estimate by a unit. Both of `bench.calibration_coverage`."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Quadratics:
    """Losses [m^2] of K transitions as c + g z + z H z / 2, about an estimate z = 0."""

    g: Float64[np.ndarray, "K Q"]
    H: Float64[np.ndarray, "K Q Q"]

    def deviation(self, weights: Float64[np.ndarray, " K"]) -> Float64[np.ndarray, " Q"]:
        """Standard deviations of the minimum's coordinates by the choice of transitions, with these weights.

        The infinitesimal jackknife (Jaeckel 1972) with the curvature of the quadratics' mean. The uncertainty along a
        direction of indistinguishable curvature is at least the range of the probes. Infinite for a coordinate on which
        the losses do not depend.
        """
        count = len(self.g)
        curvature = np.tensordot(weights, self.H, 1) / count
        values, vectors = np.linalg.eigh(curvature)
        if values[-1] < _FLAT_M2:
            return np.full(len(values), np.inf)
        least = _WEAKEST * values[-1]
        inverse = np.diag(1 / np.maximum(values, least)) @ vectors.T
        spread = inverse @ np.cov((weights[:, None] * self.g).T).reshape(curvature.shape) @ inverse.T / count
        spread += np.diag(np.where(values < least, np.maximum(0, _REACH**2 - np.diag(spread)), 0))
        deviation = np.sqrt(np.diag(vectors @ spread @ vectors.T))
        return np.where(np.diag(curvature) < _FLAT_M2, np.inf, deviation)


def fit_quadratics(
    z: Float64[np.ndarray, "M Q"], losses: Float64[np.ndarray, "M K"], gradients: Float64[np.ndarray, "M K Q"]
) -> Quadratics:
    """Least squares through losses and their gradients at M points; undetermined coefficients are 0.

    At a few points the slope of a contact is a million times the usual one, and says nothing of the loss about it: such
    gradients are weighted down in proportion to their excess.
    """
    points, free = z.shape
    rows, columns = np.triu_indices(free)
    twice = np.where(rows == columns, 0.5, 1.0)
    of_values = np.concatenate([np.ones((points, 1)), z, twice * z[:, rows] * z[:, columns]], axis=1)
    of_slopes = np.zeros((free, points, of_values.shape[1]))
    for axis in range(free):
        of_slopes[axis, :, 1 + axis] = 1
        for number, (row, column) in enumerate(zip(rows, columns, strict=True), 1 + free):
            if row == axis:
                of_slopes[axis, :, number] = z[:, column]
            elif column == axis:
                of_slopes[axis, :, number] = z[:, row]
    design = np.concatenate([of_values, of_slopes.reshape(-1, of_values.shape[1])])
    seen = np.concatenate([losses, gradients.transpose(2, 0, 1).reshape(-1, losses.shape[1])])
    steep = np.linalg.norm(gradients, axis=2)
    share = np.minimum(1, _STEEPEST * np.median(steep, axis=0) / np.maximum(steep, np.finfo(float).tiny)) ** 2
    weights = np.concatenate([np.ones_like(losses), np.tile(share, (free, 1))])
    found = np.stack(
        [np.linalg.lstsq(w[:, None] * design, w * y, rcond=None)[0] for w, y in zip(weights.T, seen.T, strict=True)],
        axis=1,
    )
    H = np.zeros((losses.shape[1], free, free))
    H[:, rows, columns] = H[:, columns, rows] = found[1 + free :].T
    return Quadratics(g=found[1 : 1 + free].T, H=H)
