"""Rest state of a liquid in a hemispherical bowl."""

import numpy as np
from jaxtyping import Float, Float64

_NARROWEST_M = 1e-3
"""Half width of a bowl at its bottom, below which it is as wide."""


def cap_depth_m(volume_m3: float, radius_m: float) -> float:
    """Depth [m] of a spherical cap of this volume in a bowl of this inner radius; the radius where it overflows."""
    depths = np.linspace(0.0, radius_m, 4097)
    return float(np.interp(volume_m3, np.pi * depths**2 * (3 * radius_m - depths) / 3, depths))


def cap_volume_m3(centroid_m: float, radius_m: float) -> float:
    """Volume [m^3] of the cap whose centroid is so far [m] below the sphere's centre; at most that of the bowl."""
    depths = np.linspace(radius_m, 0.0, 513)
    below_m = [cap_centroid_m(depth_m, radius_m) for depth_m in depths.tolist()]
    depth = float(np.interp(centroid_m, below_m, depths))
    return float(np.pi * depth**2 * (3 * radius_m - depth) / 3)


def cap_centroid_m(depth_m: float, radius_m: float) -> float:
    """Distance [m] of the centroid of a cap of this depth below the sphere's centre."""
    return 3 * (2 * radius_m - depth_m) ** 2 / (4 * (3 * radius_m - depth_m))


def centre_of_bowl(x: Float[np.ndarray, "K 3"], radius_m: float, volume_m3: float) -> Float64[np.ndarray, "3"]:
    """Centre [m] of the sphere of an upright bowl in which the liquid `x` (K, 3) [m] rests."""
    depth = cap_depth_m(volume_m3, radius_m)
    return x.mean(axis=0).astype(np.float64) + np.array([0.0, 0.0, cap_centroid_m(depth, radius_m)])


def refill(
    x: Float64[np.ndarray, "K 3"], centre: Float64[np.ndarray, "3"], radius_m: float, volume_m3: float, to_m3: float
) -> Float64[np.ndarray, "K 3"]:
    """Points [m] of a liquid that rests in an upright bowl about `centre`, where it is `to_m3` and not `volume_m3`.

    Each of its levels goes to the same share of the depth, and is widened as the bowl is there.
    """
    rises = cap_depth_m(to_m3, radius_m) / cap_depth_m(volume_m3, radius_m)
    away = x - centre
    low = np.clip(away[:, 2] + radius_m, 0.0, 2 * radius_m)
    high = np.minimum(rises * low, 2 * radius_m)
    before, after = (np.sqrt(np.maximum(height * (2 * radius_m - height), _NARROWEST_M**2)) for height in (low, high))
    return centre + np.column_stack([away[:, :2] * (after / before)[:, None], high - radius_m])


def cap_surface_m2(volume_m3: float, radius_m: float) -> float:
    """Area [m^2] of the level of a liquid of this volume in a bowl of this inner radius."""
    depth = cap_depth_m(volume_m3, radius_m)
    return float(np.pi * depth * (2 * radius_m - depth))
