"""Load of the object on the tool that pushes it: Coulomb friction of what it moves."""

import numpy as np
from scipy.spatial import KDTree

from app.core.geometry.track import Track
from app.core.types import Points
from app.discovery.dataset.model_under_test import Subject
from app.discovery.sensor_actuator_errors.base import Load
from app.sim.model.params import index

_TOUCH_M = 0.018
"""Distance from the tip to the nearest particle at contact."""
_SLOW_M_S = 0.01
_STILL_M = 2e-3
_LEAST_SHARE = 0.1


def resisting(track: Track, x: Points, share: float, subject: Subject) -> Load:
    """Coulomb friction of a share of the object `x` against the tool's motion, from the first touch on."""
    tip, velocity = track.positions, track.velocity(track.times_s)
    near = np.asarray(KDTree(x[:, :2]).query(tip[:, :2])[0])
    low = tip[:, 2] < subject.low_m
    touched = np.maximum.accumulate((near < _TOUCH_M) & low) & low
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    friction = float(subject.nominal[index("table_friction")]) * subject.mass_kg * 9.81
    return Load(-share * friction * touched[:, None] * velocity / np.maximum(speed, _SLOW_M_S))


def dragging(track: Track, before: Points, after: Points, subject: Subject) -> Load:
    """Load on a tool that pushes along `track`, by the share of the object that it moved."""
    moved = np.asarray(KDTree(after[:, :2]).query(before[:, :2])[0])
    share = float((moved > 3 * np.median(moved) + _STILL_M).mean())
    return resisting(track, before, max(share, _LEAST_SHARE), subject)
