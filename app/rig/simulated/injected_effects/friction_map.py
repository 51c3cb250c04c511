"""Friction map: the table's friction varies with position, by the factor 1 + g . (x - x0), at least a twentieth."""

import numpy as np

from app.rig.simulated.injected_effects.base import ON_TABLES, Factors, Hidden, Moment, Values, components, level

_MIDDLE_M = np.array([0.55, 0.0])
"""x0: position at which friction is unchanged."""
_LEAST = 0.05


def _friction(moment: Moment, values: Values) -> Factors:
    return np.maximum(_LEAST, 1.0 + (moment.x[:, :2] - _MIDDLE_M) @ values)


HIDDEN = Hidden(
    family="physics",
    bodies=ON_TABLES,
    quantities=components("friction_slope", "xy", "1/m", 1.0, 3.0),
    draw=level,
    friction=_friction,
)
