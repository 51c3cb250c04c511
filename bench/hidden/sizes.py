"""Sizes of ropes and fingers as labs differ in them, drawn from a seed, and the task that is about such a pair."""

from math import pi
from typing import Final

import numpy as np

from app.commands._named import Dynamics
from app.tasks import name_with_dynamics

RADIUS_M: Final = 0.004, 0.010
LENGTH_M: Final = 0.25, 0.60
MASS_KG: Final = 0.015, 0.100
FINGER_M: Final = 0.005, 0.012
HALF_WIDTH_M: Final = 0.005, 0.015
"""Range of the half width of a flat gripper."""
NOISE_M: Final = 1.0e-3, 2.5e-3
"""Range of the depth noise, at the distance of the cell's cameras."""
CAMERAS: Final = 1, 3
FLAT: Final = 0.25
"""Share of fingers that are flat grippers, in a bench that draws them."""
_SIZES: Final = 11
"""Stream of random numbers of a seed."""


def drawn_sizes(seed: int, *, flat: float = 0.0) -> dict[str, float]:
    """Sizes by their names in `object_description.SIZES`; with a chance of `flat` the finger is flat, at any yaw."""
    rng = np.random.default_rng([seed, _SIZES])
    sizes = {
        "radius_m": rng.uniform(*RADIUS_M),
        "length_m": rng.uniform(*LENGTH_M),
        "mass_kg": np.exp(rng.uniform(*np.log(MASS_KG))),
        "finger_radius_m": rng.uniform(*FINGER_M),
    }
    shape = np.random.default_rng([seed, _SIZES, 2])
    if shape.uniform() < flat:
        sizes |= {"finger_half_width_m": shape.uniform(*HALF_WIDTH_M), "finger_yaw_rad": shape.uniform(-pi, pi)}
    return {name: float(f"{value:.5g}") for name, value in sizes.items()}


def drawn_task(seed: int, dynamics: Dynamics, *, flat: float = 0.0) -> str:
    """The full name of the task of a drawn rope and finger."""
    sizes = ",".join(f"{name}={value:.5g}" for name, value in drawn_sizes(seed, flat=flat).items())
    return name_with_dynamics(f"rope_push({sizes})", dynamics)


def drawn_cameras(seed: int) -> tuple[int, float]:
    """Number of cameras, and the noise of their depth [m] at the distance of the cell's."""
    rng = np.random.default_rng([seed, _SIZES, 3])
    return int(rng.integers(CAMERAS[0], CAMERAS[1] + 1)), float(rng.uniform(*NOISE_M))
