"""The Chamfer distance, for NumPy and JAX arrays alike."""

from typing import Any, TypeVar, cast

ArrayT = TypeVar("ArrayT")


def chamfer_m2(x: ArrayT, y: ArrayT) -> ArrayT:
    """Symmetric squared Chamfer distance [m^2] between point sets `x (..., N, 3)` and `y (..., M, 3)`; shape (...).

    mean_x min_y |x - y|^2 + mean_y min_x |x - y|^2. Squares only, no root: its gradient is finite everywhere, also
    where two points coincide. Dense over N x M, which for the particle counts of this program beats a tree.
    """
    # NumPy and JAX share the operators used here, and no common static type expresses that.
    a, b = cast(Any, x), cast(Any, y)
    squared = ((a[..., :, None, :] - b[..., None, :, :]) ** 2).sum(-1)
    return squared.min(-1).mean(-1) + squared.min(-2).mean(-1)
