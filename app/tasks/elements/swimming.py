"""Problems of pouring a soup: a liquid with pieces that swim in it."""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64

from app.core.geometry.bowls import cap_depth_m
from app.core.geometry.scene_description import Pieces, Soup
from app.core.geometry.shapes.fixtures import Bowl
from app.core.geometry.shapes.tools import HeldBowl
from app.core.types import Points
from app.perception.body.floating_pieces import Swimming
from app.perception.body.resample import resample
from app.tasks.elements.base import Nodes
from app.tasks.elements.pouring import aside_m, pool_points

_POINTS_A_PARTICLE = 16
_APART = 1.4
"""Pieces begin on a ring of this radius in edges, one of them in its middle: six of them do not touch."""


@final
@dataclass(frozen=True, kw_only=True)
class SoupProblems:
    """All of the soup rests in the held bowl, a little aside and turned by seed, and shall be in the other.

    Nodes of a world are the liquid's drops and then the grains of each piece; `seen`: how they are told apart.
    """

    soup: Soup
    seen: Swimming
    held: HeldBowl
    target: Bowl
    home_m: tuple[float, float, float]

    def start(self, seed: int) -> Nodes:
        """The soup in the held bowl, its pieces in any order."""
        rng = np.random.default_rng([seed, 1])
        return self._bowl_nodes(self.held.radius_m, rng) + self.home_m + aside_m(seed)

    def goal(self, seed: int, particle_count: int) -> Points:
        """The soup at rest in the other bowl, wherever its pieces are."""
        rng = np.random.default_rng([seed, 2])
        return self.particles(self._bowl_nodes(self.target.radius_m, rng) + self.target.place_m, particle_count)

    def particles(self, nodes: Nodes, particle_count: int) -> Points:
        """The liquid's and then the pieces', each sharing the world's."""
        drops = self.soup.liquid.drops
        parts = zip((nodes[:drops], nodes[drops:]), self.seen.split(particle_count), strict=True)
        return np.concatenate([resample(part.astype(np.float32), count, seed=0) for part, count in parts])

    def _bowl_nodes(self, radius_m: float, rng: np.random.Generator) -> Nodes:
        """Nodes in a bowl about the origin: pieces under the surface, and the liquid around them."""
        soup = self.soup
        level = cap_depth_m(soup.volume_m3, radius_m) - radius_m
        kinds = [kind for kind in soup.pieces for _ in range(kind.count)]
        yaw, places = rng.uniform(0, 2 * np.pi), rng.permutation(len(kinds))
        pool = pool_points(radius_m, soup.volume_m3, _POINTS_A_PARTICLE * soup.liquid.drops)
        grains = list[Nodes]()
        for kind, place in zip(kinds, places, strict=True):
            turn = yaw + 2 * np.pi * place / (len(kinds) - 1)
            out = _APART * kind.edge_m if place else 0.0
            middle = np.array([out * np.cos(turn), out * np.sin(turn), level - kind.edge_m / 2])
            frame = np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
            pool = pool[np.abs((pool - middle) @ frame).max(axis=1) > kind.edge_m / 2]
            grains.append(_cube(kind) @ frame.T + middle)
        liquid = resample(pool, soup.liquid.drops, seed=0)
        return np.concatenate([liquid, *grains])


def _cube(kind: Pieces) -> Float64[np.ndarray, "K 3"]:
    """The grains of one piece about its middle [m]."""
    axis = (np.arange(kind.along) - (kind.along - 1) / 2) * kind.edge_m / kind.along
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
