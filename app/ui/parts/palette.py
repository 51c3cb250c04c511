"""Colours of the scene, distinguishable for colour-blind eyes and on dark and light ground (after Okabe and Ito)."""

from typing import Final, TypeAlias

import numpy as np

Colour: TypeAlias = tuple[int, int, int]
"""Red, green, blue in 0..255."""

OBSERVED: Final[Colour] = (240, 138, 36)
UNSEEN: Final[Colour] = (150, 104, 62)
"""Colour of hidden particles: that of observed ones, in shade."""
GOAL: Final[Colour] = (0, 158, 115)
PREDICTED: Final[Colour] = (86, 180, 233)
HORIZON: Final[Colour] = (150, 120, 220)
EXPECTED: Final[Colour] = (240, 228, 66)
BEST: Final[Colour] = (232, 62, 140)
DRAFT: Final[Colour] = (255, 255, 255)
MEASURED: Final[Colour] = (204, 160, 0)
LOOKED: Final[Colour] = (40, 210, 215)
COMPARED: Final[Colour] = (196, 90, 240)
CHEAP: Final[Colour] = (70, 120, 255)
DEAR: Final[Colour] = (120, 106, 96)
TABLE: Final[Colour] = (92, 98, 108)
OUTLINE: Final[Colour] = (150, 158, 170)
FORBIDDEN: Final[Colour] = (220, 60, 60)
STEEL: Final[Colour] = (176, 184, 196)
MASK: Final[Colour] = (255, 40, 200)
PREVIEW: Final[Colour] = (0, 230, 230)
SURFACE: Final[Colour] = (255, 255, 255)
_CAMERAS: Final[tuple[Colour, ...]] = ((230, 90, 60), (60, 150, 240), (110, 200, 80), (220, 180, 40))


def by_cost(costs: np.ndarray) -> np.ndarray:
    """A colour for each cost `(K,)`, from CHEAP to DEAR by rank; shape (K, 3), uint8.

    By rank, because one diverged branch would make all others look alike.
    """
    ranks = np.argsort(np.argsort(costs)) / max(len(costs) - 1, 1)
    return np.rint((1 - ranks[:, None]) * np.array(CHEAP) + ranks[:, None] * np.array(DEAR)).astype(np.uint8)


def camera(number: int) -> Colour:
    """Colour of a camera's points."""
    return _CAMERAS[number % len(_CAMERAS)]


def of_light(albedo: tuple[float, float, float]) -> Colour:
    """Screen colour of an RGB albedo in 0..1."""
    red, green, blue = (round(255 * share) for share in albedo)
    return red, green, blue


def linear(colours: Colour | np.ndarray) -> np.ndarray:
    """Screen colours as linear light; uint8, same shape.

    Viser 1.1.1 converts the colour of a whole object, and hands colours given per vertex or per instance to the shader
    as they are.
    """
    return np.rint(255 * (np.asarray(colours) / 255) ** 2.2).astype(np.uint8)
