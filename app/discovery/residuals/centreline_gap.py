"""Residuals of a rope of known length and radius: from where its centreline was predicted to where it is seen.

An embedding's registration finds a rope's displacement to 2 to 4 mm, as the order of its points is unknown to it. A rod
that is fitted to either cloud is known to a millimetre (`sim.rods.geometry.centreline`), along the rope, too.
"""

from functools import lru_cache

import numpy as np
from jaxtyping import Float32, Float64

from app.core.types import Points
from app.sim.rods.geometry.arc_length import centreline_weights
from app.sim.rods.geometry.centreline import settle, trace
from app.sim.rods.geometry.polyline import without_strain
from app.sim.rods.geometry.rope_cloud import RopeShape

_COARSE = 3
"""Nodes over which a strain is averaged: between next ones, a line's noise would turn it into bends."""


def centreline_gap(
    predicted: Points, observed: Points, along: Float32[np.ndarray, " N"], rope: RopeShape
) -> Float64[np.ndarray, "N 2"]:
    """Displacement [m] of each predicted particle that takes the predicted centreline to the observed one.

    `along`: places of the particles along the rope, from 0 to 1. Where the observed cloud allows for several orders of
    its strands, that one counts which is nearer to the prediction.
    """
    line = _line_of(predicted, along, rope)
    apart = trace(observed, rope).near(line) - line
    return _at_particles(apart[None], along * (rope.count - 1))[0]


def with_length_kept(
    displaced: Float64[np.ndarray, "C N 2"], predicted: Points, along: Float32[np.ndarray, " N"], rope: RopeShape
) -> Float64[np.ndarray, "C N 2"]:
    """Displacements [m] as `centreline_gap` would find them: a line of known length shows no strain.

    Cameras that err in scale, or lose the rope's outline, make it look shorter.
    """
    weights = centreline_weights(along, max(rope.count // _COARSE, 2)).astype(np.float64)
    line = _at_particles(_line_of(predicted, along, rope)[None], along * (rope.count - 1))[0]
    averaged = weights @ displaced
    change = without_strain(averaged, weights @ line) - averaged
    return displaced + _at_particles(change, along * len(weights) - 0.5)


def _line_of(predicted: Points, along: Float32[np.ndarray, " N"], rope: RopeShape) -> Float64[np.ndarray, "n 2"]:
    """Centreline through predicted particles."""
    return _settled(*(np.ascontiguousarray(each, np.float32).tobytes() for each in (predicted, along)), rope)


def _at_particles(
    values: Float64[np.ndarray, "C n 2"], place: Float32[np.ndarray, " N"]
) -> Float64[np.ndarray, "C N 2"]:
    """Values of nodes at these places, counted in nodes: linear between and beyond them."""
    first = np.clip(np.floor(place), 0, values.shape[1] - 2).astype(int)
    share = (place - first)[:, None]
    return (1 - share) * values[:, first] + share * values[:, first + 1]


@lru_cache(maxsize=1)
def _settled(points: bytes, along: bytes, rope: RopeShape) -> Float64[np.ndarray, "n 2"]:
    """The same, as is asked of one prediction by residuals and slopes."""
    x, places = np.frombuffer(points, np.float32).reshape(-1, 3), np.frombuffer(along, np.float32)
    return settle(x, centreline_weights(places, rope.count) @ x[:, :2].astype(np.float64), rope)
