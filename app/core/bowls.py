"""How a liquid stands in half of a hollow sphere."""

import numpy as np
from jaxtyping import Float, Float64


def cap_depth_m(volume_m3: float, radius_m: float) -> float:
    """How deep this volume stands, in a bowl of this inner radius; the radius where it would run over."""
    depths = np.linspace(0.0, radius_m, 4097)
    return float(np.interp(volume_m3, np.pi * depths**2 * (3 * radius_m - depths) / 3, depths))


def cap_centroid_m(depth_m: float, radius_m: float) -> float:
    """How far the middle of what stands so deep is below the sphere's centre [m]."""
    return 3 * (2 * radius_m - depth_m) ** 2 / (4 * (3 * radius_m - depth_m))


def centre_of_bowl(x: Float[np.ndarray, "K 3"], radius_m: float, volume_m3: float) -> Float64[np.ndarray, "3"]:
    """Where the sphere's centre of an upright bowl is in which the liquid `x` rests [m]."""
    depth = cap_depth_m(volume_m3, radius_m)
    return x.mean(axis=0).astype(np.float64) + np.array([0.0, 0.0, cap_centroid_m(depth, radius_m)])
