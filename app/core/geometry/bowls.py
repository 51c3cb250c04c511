"""Rest state of a liquid in a hemispherical bowl."""

import numpy as np
from jaxtyping import Float, Float64


def cap_depth_m(volume_m3: float, radius_m: float) -> float:
    """Depth [m] of a spherical cap of this volume in a bowl of this inner radius; the radius where it overflows."""
    depths = np.linspace(0.0, radius_m, 4097)
    return float(np.interp(volume_m3, np.pi * depths**2 * (3 * radius_m - depths) / 3, depths))


def cap_centroid_m(depth_m: float, radius_m: float) -> float:
    """Distance [m] of the centroid of a cap of this depth below the sphere's centre."""
    return 3 * (2 * radius_m - depth_m) ** 2 / (4 * (3 * radius_m - depth_m))


def centre_of_bowl(x: Float[np.ndarray, "K 3"], radius_m: float, volume_m3: float) -> Float64[np.ndarray, "3"]:
    """Centre [m] of the sphere of an upright bowl in which the liquid `x` (K, 3) [m] rests."""
    depth = cap_depth_m(volume_m3, radius_m)
    return x.mean(axis=0).astype(np.float64) + np.array([0.0, 0.0, cap_centroid_m(depth, radius_m)])


def cap_surface_m2(volume_m3: float, radius_m: float) -> float:
    """Area [m^2] of the level of a liquid of this volume in a bowl of this inner radius."""
    depth = cap_depth_m(volume_m3, radius_m)
    return float(np.pi * depth * (2 * radius_m - depth))
