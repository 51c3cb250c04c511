"""Floating pieces in a liquid: their part of the content of bowls, from their visible tops."""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float32
from scipy.spatial import KDTree

from app.core.colours import ColourRange
from app.core.types import Cloud


@final
@dataclass(frozen=True, kw_only=True)
class Swimming:
    """Pieces of these colours, one a kind, with this `share` of the whole volume.

    `below_m`: depth of their middles below their visible surface.
    """

    colours: tuple[ColourRange, ...]
    share: float
    below_m: float

    def split(self, particle_count: int) -> tuple[int, int]:
        """Number of particles of the liquid and of the pieces, of this total."""
        solid = int(np.rint(particle_count * self.share))
        return particle_count - solid, solid

    def apart(
        self, body: Cloud, seen: Float32[np.ndarray, "tops 3"]
    ) -> tuple[Float32[np.ndarray, "liquid 3"], Float32[np.ndarray, "solid 3"]]:
        """Points of the whole body, split into liquid and pieces, whose visible tops are `seen`.

        The pieces' points are the nearest to the middles below the tops, as many as their volume: a piece hidden by
        another, or under the surface, is assumed with the others. Where none is visible, they are anywhere.
        """
        count = self.split(len(body))[1]
        if len(seen):
            away = KDTree(seen - np.array([0.0, 0.0, self.below_m], np.float32)).query(body)[0]
        else:
            away = np.random.default_rng(0).random(len(body))
        solid = np.zeros(len(body), bool)
        solid[np.argsort(away, kind="stable")[:count]] = True
        return body[~solid], body[solid]
