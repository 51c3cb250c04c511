"""Quadratics through the losses about an estimate, one a transition, and how well they tell where their minimum is.

A Chamfer distance has a floor, and its nearest neighbours change with every step: its curvature at a point says little,
and a quadratic through many points about it what is wanted.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64

_FLAT_M2 = 1e-9
"""Less curvature than this is none: half of it is the loss [m^2] that a step of one unit would cost on the average."""
_INVOLVED = 0.5
"""A coordinate with so much of a direction is unknown where nothing is known along that."""
_WEAKEST = 0.005
"""Share of the largest curvature that the smallest is taken to have at least: less cannot be told from none."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Quadratics:
    """Losses [m^2] of K transitions as c + g z + z H z / 2, about an estimate z = 0."""

    g: Float64[np.ndarray, "K Q"]
    H: Float64[np.ndarray, "K Q Q"]

    def deviation(self, weights: Float64[np.ndarray, " K"]) -> Float64[np.ndarray, " Q"]:
        """Standard deviations of the minimum's coordinates by the choice of transitions, which weigh so much.

        The infinitesimal jackknife (Jaeckel 1972) with the curvature of the quadratics' mean. Infinite for what is
        involved in a direction along which the losses are flat.
        """
        count = len(self.g)
        values, vectors = np.linalg.eigh(np.tensordot(weights, self.H, 1) / count)
        if values[-1] < _FLAT_M2:
            return np.full(len(values), np.inf)
        inverse = vectors @ np.diag(1 / np.maximum(values, _WEAKEST * values[-1])) @ vectors.T
        spread = np.cov((weights[:, None] * self.g).T).reshape(inverse.shape) / count
        unknown = (np.abs(vectors[:, values < _FLAT_M2]) > _INVOLVED).any(1)
        return np.where(unknown, np.inf, np.sqrt(np.diag(inverse @ spread @ inverse)))


def fit_quadratics(
    z: Float64[np.ndarray, "M Q"], losses: Float64[np.ndarray, "M K"], gradients: Float64[np.ndarray, "M K Q"]
) -> Quadratics:
    """Least squares through losses and their gradients at M points; what these leave open is 0."""
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
    found = np.linalg.lstsq(design, seen, rcond=None)[0]
    H = np.zeros((losses.shape[1], free, free))
    H[:, rows, columns] = H[:, columns, rows] = found[1 + free :].T
    return Quadratics(g=found[1 : 1 + free].T, H=H)
