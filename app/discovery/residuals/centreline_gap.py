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
from app.sim.rods.geometry.polyline import places
from app.sim.rods.geometry.rope_cloud import RopeShape

_ASTRAY = 0.15
"""Share of a rope's length by which a particle's place may differ from its rank: beyond it is on another strand."""


def centreline_gap(
    predicted: Points, observed: Float32[np.ndarray, "M 3"], along: Float32[np.ndarray, " N"], rope: RopeShape
) -> Float64[np.ndarray, "N 2"]:
    """Displacement [m] of each predicted particle that takes the predicted centreline to the observed one.

    `along`: ranks of the particles along the rope, from 0 to 1. Where the observed cloud allows for several orders of
    its strands, that one counts which is nearer to the prediction.
    """
    line = _line_of(predicted, along, rope)
    return _at_particles(trace(observed, rope).near(line) - line, predicted, along, line)


def gap_of_displaced(
    displaced: Float64[np.ndarray, "N 3"], predicted: Points, along: Float32[np.ndarray, " N"], rope: RopeShape
) -> Float64[np.ndarray, "N 2"]:
    """Displacement [m] that a cloud is found to have whose particles are `displaced` [m].

    A line of known length shows no strain, which cameras make that err in scale or lose the rope's outline.
    """
    line = _line_of(predicted, along, rope)
    moved = settle((predicted + displaced).astype(np.float32), line, rope)
    return _at_particles(moved - line, predicted, along, line)


def _line_of(predicted: Points, along: Float32[np.ndarray, " N"], rope: RopeShape) -> Float64[np.ndarray, "n 2"]:
    """Centreline through predicted particles."""
    return _settled(*(np.ascontiguousarray(each, np.float32).tobytes() for each in (predicted, along)), rope)


def _at_particles(
    values: Float64[np.ndarray, "n 2"],
    predicted: Points,
    along: Float32[np.ndarray, " N"],
    line: Float64[np.ndarray, "n 2"],
) -> Float64[np.ndarray, "N 2"]:
    """Values of the nodes of a line at its particles, by their places on it: ranks are no places in an uneven cloud."""
    last = len(line) - 1
    at, ranks = places(line[None], predicted[:, :2].astype(np.float64))[0][0], along * last
    at = np.where(np.abs(at - ranks) < _ASTRAY * last, at, ranks)
    return np.stack([np.interp(at, np.arange(len(line)), column) for column in values.T], axis=1)


@lru_cache(maxsize=1)
def _settled(points: bytes, along: bytes, rope: RopeShape) -> Float64[np.ndarray, "n 2"]:
    """Nodes of the line through a prediction, for which residual and slopes of a view ask one after the other."""
    x, ranks = np.frombuffer(points, np.float32).reshape(-1, 3), np.frombuffer(along, np.float32)
    return settle(x, centreline_weights(ranks, rope.count) @ x[:, :2].astype(np.float64), rope)
