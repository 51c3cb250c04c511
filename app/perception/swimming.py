"""Pieces that swim in a liquid: which part of what stands in bowls they are, by what is seen of their tops."""

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
    """Pieces of these colours, one a kind, which are this `share` of the whole volume.

    `below_m`: how far their middles are below what is seen of them.
    """

    colours: tuple[ColourRange, ...]
    share: float
    below_m: float

    def split(self, particle_count: int) -> tuple[int, int]:
        """How many of so many particles are the liquid's, and how many the pieces'."""
        solid = int(np.rint(particle_count * self.share))
        return particle_count - solid, solid

    def apart(
        self, body: Cloud, seen: Float32[np.ndarray, "tops 3"]
    ) -> tuple[Float32[np.ndarray, "liquid 3"], Float32[np.ndarray, "solid 3"]]:
        """Points of the whole body as those of the liquid and those of the pieces, whose tops `seen` are.

        Pieces are what is nearest to the middles that the tops tell of, as much as they have of the volume: one that is
        hidden by another, or under the surface, is taken to be with the others. Where none is seen, they are anywhere.
        """
        count = self.split(len(body))[1]
        if len(seen):
            away = KDTree(seen - np.array([0.0, 0.0, self.below_m], np.float32)).query(body)[0]
        else:
            away = np.random.default_rng(0).random(len(body))
        solid = np.zeros(len(body), bool)
        solid[np.argsort(away, kind="stable")[:count]] = True
        return body[~solid], body[solid]
