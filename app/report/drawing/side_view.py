"""Drawings seen from the side: along the way of the tool, and upwards, of what is carried or poured."""

from collections.abc import Callable
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float

from app.sim.effects.base import LIQUIDS, ObjectKind

Projection: TypeAlias = Callable[[Float[np.ndarray, "M 3"]], Float[np.ndarray, "M 3"]]
"""Places [m] as they are drawn: across and up in the first two columns."""


class View(NamedTuple):
    """Names of a drawing's axes, and whence it is seen."""

    axes: tuple[str, str]
    whence: str


ABOVE: Final = View(("x [m]", "y [m]"), "from above")
SIDE: Final = View(("along the motion [m]", "height [m]"), "from the side")


def view_of(kind: ObjectKind) -> View:
    """The view that shows a kind of object best."""
    return SIDE if kind in LIQUIDS | {"cloth"} else ABOVE


def projection(kind: ObjectKind, tool: Float[np.ndarray, "T 3"]) -> Projection:
    """Places of an object and a tool in its view, which for one from the side is along the tool's farthest way."""
    if view_of(kind) is ABOVE:
        return lambda points: points
    way_m = tool[:, :2] - tool[0, :2]
    farthest = way_m[np.argmax(np.linalg.norm(way_m, axis=1))]
    ahead = farthest / max(float(np.linalg.norm(farthest)), 1e-9)

    def seen(points: Float[np.ndarray, "M 3"]) -> Float[np.ndarray, "M 3"]:
        along = (points[:, :2] - tool[0, :2]) @ ahead
        return np.stack([along, points[:, 2], np.zeros(len(points))], axis=1).astype(points.dtype)

    return seen
