"""Solid regions of fixtures."""

import numpy as np
from jaxtyping import Bool

from app.core.geometry.scene_description import Bowl, Fixture, Mat, Obstacle, Rack
from app.core.types import Cloud


def inside(fixture: Fixture, points: Cloud, margin_m: float) -> Bool[np.ndarray, " M"]:
    """Mask of the points (M, 3) [m] that lie deeper than `margin_m` inside the fixture's solid."""
    x = points.astype(np.float64)
    match fixture:
        case Mat():
            return np.zeros(len(x), np.bool_)
        case Obstacle():
            return np.all(np.abs(x - fixture.place_m) < np.asarray(fixture.half_m) - margin_m, axis=1)
        case Bowl():
            away = x - fixture.place_m
            off_wall = np.abs(np.linalg.norm(away, axis=1) - fixture.radius_m - fixture.thickness_m / 2)
            return (off_wall < fixture.thickness_m / 2 - margin_m) & (away[:, 2] < 0)
        case Rack():
            deep = np.zeros(len(x), np.bool_)
            for start, end in np.asarray(fixture.ends_m()):
                along = (end - start) / np.linalg.norm(end - start)
                at = np.clip((x - start) @ along, 0.0, np.linalg.norm(end - start))
                deep |= np.linalg.norm(x - start - at[:, None] * along, axis=1) < fixture.radius_m - margin_m
            return deep
