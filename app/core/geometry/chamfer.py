"""The Chamfer distance, for NumPy and JAX arrays alike."""

from typing import Any, TypeVar, cast

import numpy as np
from scipy.spatial import KDTree

ArrayT = TypeVar("ArrayT")


def chamfer_m2(x: ArrayT, y: ArrayT) -> ArrayT:
    """Symmetric squared Chamfer distance [m^2] between point sets `x (..., N, 3)` and `y (..., M, 3)`; shape (...).

    mean_x min_y |x - y|^2 + mean_y min_x |x - y|^2. Squares only, no root: its gradient is finite everywhere, also
    where two points coincide. Dense over N x M, but for two NumPy clouds by trees: the event loop takes this distance.
    """
    if isinstance(x, np.ndarray) and isinstance(y, np.ndarray) and x.ndim == y.ndim == 2:
        return cast(Any, _between_clouds(x, y))
    # Each of both is of one library, or NumPy's beside JAX's, and no common static type expresses that.
    a, b = cast(Any, x), cast(Any, y)
    if not (isinstance(x, np.ndarray) and isinstance(y, np.ndarray)):
        from app.core.geometry.chamfer_slope import (
            chamfer_of_pairs_m2,  # Processes without JAX take this distance as well.
        )

        return cast(Any, chamfer_of_pairs_m2(a, b))
    squared = ((a[..., :, None, :] - b[..., None, :, :]) ** 2).sum(-1)
    return squared.min(-1).mean(-1) + squared.min(-2).mean(-1)


def _between_clouds(x: np.ndarray, y: np.ndarray) -> np.floating[Any]:
    """The same for `x (N, 3)` and `y (M, 3)`, in 4 ms instead of 130 at 2000 points; NaN where not all are finite."""
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        return np.float64(np.nan)
    to_y, to_x = KDTree(y).query(x)[0], KDTree(x).query(y)[0]
    return np.float64((to_y**2).mean() + (to_x**2).mean())
