"""Random pushes of the simulated cell as tracks of discovery: what bench and tests make its studies of."""

import numpy as np

from app.core.types import Points
from app.discovery.study import Track
from app.rig.simulated import strokes
from app.rig.simulated.strokes import REGION, Plan

__all__ = ["REGION", "Plan", "midway_s", "random_track"]


def random_track(rng: np.random.Generator, x: Points, plan: Plan, *, start_s: float, height_m: float) -> Track:
    """As `strokes.random_track`."""
    track = strokes.random_track(rng, x, plan, start_s=start_s, height_m=height_m)
    return Track(times_s=track.times_s, poses=track.poses)


def midway_s(track: Track) -> float:
    """As `strokes.midway_s`."""
    return strokes.midway_s(track.times_s)
