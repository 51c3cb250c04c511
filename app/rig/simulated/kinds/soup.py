"""A liquid with pieces in it, poured from a held bowl into a fixed one."""

import numpy as np

from app.core.geometry.scene_description import Soup, Stage
from app.rig.simulated.kinds.liquid import build, home, pool
from app.rig.simulated.worlds.kind import Kind
from app.rig.simulated.worlds.shapes import Surface, lump
from app.rig.simulated.worlds.world import Nodes


def _node_count(stage: Stage) -> int:
    soup = _soup(stage)
    return soup.liquid.drops + sum(kind.grains for kind in soup.pieces)


def _surfaces(stage: Stage, nodes: Nodes) -> list[Surface]:
    """Surfaces of the drops, and of each piece as the hull of its particles, which lie inside it."""
    soup = _soup(stage)
    surfaces, begin = [pool(soup.liquid, nodes[: soup.liquid.drops])], soup.liquid.drops
    for kind in soup.pieces:
        grains = nodes[begin : begin + kind.grains].reshape(kind.count, -1, 3)
        skin = np.sqrt(3) / 2 * kind.edge_m / kind.along
        surfaces += [lump(piece, skin, kind.colour) for piece in grains]
        begin += kind.grains
    return surfaces


def _soup(stage: Stage) -> Soup:
    if not isinstance(stage.body, Soup):
        raise TypeError(f"{type(stage.body).__name__} is not a soup.")
    return stage.body


KIND = Kind(body=Soup, node_count=_node_count, build=build, surfaces=_surfaces, home=home)
