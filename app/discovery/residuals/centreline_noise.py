"""Errors of cameras along a slender object: smooth, as its centreline is fitted to all of its points."""

import numpy as np
from jaxtyping import Float, Float64

WAVES = 7
"""A shift, and cosines of up to six half waves along the object."""


def smooth_noise(
    rng: np.random.Generator, along: Float[np.ndarray, " N"], deviation_m: float
) -> Float64[np.ndarray, "N 2"]:
    """Level displacements [m] of points at `along` (-1 to 1), of that standard deviation an axis in the mean."""
    waves = np.cos(np.pi / 2 * np.arange(WAVES) * (along[:, None] + 1))
    waves[:, 1:] *= np.sqrt(2)
    return deviation_m / np.sqrt(WAVES) * waves @ rng.standard_normal((WAVES, 2))
