"""A poured liquid as cameras and their reconstruction show it, without images."""

from typing import Final

import numpy as np
from jaxtyping import Float64

from app.core.geometry.bowls import cap_depth_m
from app.core.geometry.scene_description import Liquid, Soup
from app.core.types import Cloud, Points, ToolPose
from app.perception.body.resample import resample
from app.perception.body.vessels import Pool
from app.tasks.elements.base import Nodes, Task

LEVEL_M: Final = 0.5e-3
"""Noise of a level that two rendered cameras see."""
_POINTS: Final = 4000
"""Points of the liquid that its particles are means of."""
_LEAST: Final = 0.02
"""Share of the liquid below which a level is not seen."""


def seen_pour(
    task: Task,
    nodes: Nodes,
    count: int,
    rng: np.random.Generator,
    *,
    tip: ToolPose,
    told: ToolPose,
    more: float = 0.0,
    level_m: float = LEVEL_M,
) -> Points:
    """The liquid at `nodes` [m] as `count` particles, with the noise `level_m` of its level.

    It stands in the fixed bowl to its level; the rest is where the kinematics have the held one, at `told`, which truly
    is at `tip`. Pieces in it are seen where they are not under that level. `more`: the share of what the task says by
    which there is more of it, which nobody sees.
    """
    fixed, held = task.perception.standing[0], task.perception.held
    volume_m3 = task.perception.volume_m3
    assert held is not None
    place = np.array(fixed.place_m)
    aside = np.linalg.norm(nodes - tip[:3], axis=1) > held.radius_m + _wall_m(task)
    inside = aside & (np.linalg.norm(nodes - place, axis=1) < fixed.radius_m)
    poured_m3 = float(_volumes_m3(task, len(nodes), more) @ inside)
    pools = list[Pool]()
    if poured_m3 > _LEAST * volume_m3:
        level = place[2] - fixed.radius_m + cap_depth_m(poured_m3, fixed.radius_m) + level_m * rng.standard_normal()
        pools.append(Pool(vessel=fixed, level_m=float(level)))
    left_m3 = volume_m3 - sum(pool.volume_m3 for pool in pools)
    if left_m3 > _LEAST * volume_m3:
        pools.append(held.at(told).pool(left_m3))
    spacing_m = float(np.cbrt(volume_m3 / _POINTS))
    body, seed = np.concatenate([pool.points(spacing_m) for pool in pools]), int(rng.integers(2**31))
    swimming = task.perception.swimming
    if swimming is None:
        return resample(body, count, seed=seed)
    top_m = max((pool.level_m for pool in pools if pool.vessel == fixed), default=fixed.place_m[2] - fixed.radius_m)
    tops = _tops(task, nodes)
    hidden = (np.linalg.norm(tops - place, axis=1) < fixed.radius_m) & (tops[:, 2] < top_m)
    parts = zip(swimming.apart(body, tops[~hidden]), swimming.split(count), strict=True)
    return np.concatenate([resample(part, own, seed=seed) for part, own in parts])


def _tops(task: Task, nodes: Nodes) -> Cloud:
    """Tops of the pieces in a soup, above the middles of each."""
    soup = task.stage.body
    assert isinstance(soup, Soup)
    from app.rig.simulated.worlds.liquid_world import particles  # Loads JAX and Warp.

    tops, begin = list[Nodes](), particles(soup, len(nodes))[0]
    for kind in soup.pieces:
        middles = nodes[begin : begin + kind.grains].reshape(kind.count, -1, 3).mean(axis=1)
        tops.append(middles + np.array([0.0, 0.0, kind.edge_m / 2]))
        begin += kind.grains
    return np.concatenate(tops).astype(np.float32)


def _wall_m(task: Task) -> float:
    return float(task.stage.tool.bowl_m or 0.0) - (task.perception.held.radius_m if task.perception.held else 0.0)


def _volumes_m3(task: Task, count: int, more: float) -> Float64[np.ndarray, " K"]:
    """Volume of each of so many nodes, of which those of pieces are last."""
    body = task.stage.body
    assert isinstance(body, Liquid | Soup)
    from app.rig.simulated.worlds.liquid_world import particles  # Loads JAX and Warp.

    filled = body.with_more(more * body.volume_m3)
    counts = particles(filled, count)
    solid = [kind.volume_m3 for kind in filled.pieces] if isinstance(filled, Soup) else []
    shares = np.array([filled.volume_m3 - sum(solid), *solid]) / counts
    return np.repeat(shares, counts)
