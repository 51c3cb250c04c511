"""Resampling of a cloud of any size to a given number of particles."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float32
from scipy.spatial import KDTree

from app.core.types import Cloud, Points
from app.perception.body.resample import resample

FEWEST = 30
"""Fewest points of an object that locate each part of it."""


def resample_to(cloud: Cloud, count: int, *, seed: int = 0) -> Points:
    """`count` particles that share the cloud evenly; the cloud itself where it has as many.

    A cloud of fewer points is densified first, with points halfway between neighbours. Raises ValueError where it has
    fewer than `FEWEST`.
    """
    if len(cloud) == count:
        return cloud
    if len(cloud) < FEWEST:
        raise ValueError(f"{len(cloud)} points are too few; at least {FEWEST} are needed.")
    return resample(_fill_up(cloud, 2 * count) if len(cloud) < count else cloud, count, seed=seed)


def resample_bodies(cloud: Cloud, count: int, split: Callable[[int], tuple[int, ...]]) -> Points:
    """The same of a cloud of several bodies, one after another; `split`: numbers of points of each, of a total."""
    if len(cloud) == count:
        return cloud
    parts = np.split(cloud, np.cumsum(split(len(cloud)))[:-1])
    return np.concatenate([resample_to(part, own) for part, own in zip(parts, split(count), strict=True)])


def _fill_up(cloud: Cloud, least: int) -> Float32[np.ndarray, "_ 3"]:
    """The cloud with points halfway to ever farther neighbours, until there are `least`."""
    parts, neighbours = [cloud], np.asarray(KDTree(cloud).query(cloud, k=FEWEST)[1])
    for rank in range(1, FEWEST):
        if sum(map(len, parts)) >= least:
            break
        parts.append((cloud + cloud[neighbours[:, rank]]) / 2)
    return np.concatenate(parts)
