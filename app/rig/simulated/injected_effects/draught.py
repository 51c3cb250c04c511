"""Draught: a level wind pulls with the share f of weight on the part above its boundary layer of 2 cm.

Drag grows with the square of the height in the layer; for a rope's section, the mean is taken.
"""

import numpy as np

from app.rig.simulated.injected_effects.base import SOLIDS, Hidden, Moment, Values, Vectors, components, level

_LAYER_M = 0.02


def _force(moment: Moment, values: Values) -> Vectors:
    # Over a disc of radius r, the mean of z^2 is that of its middle and r^2 / 4.
    exposed = np.minimum(1.0, (moment.x[:, 2] ** 2 + moment.radius_m**2 / 4) / _LAYER_M**2)
    return (moment.mass * moment.gravity_m_s2 * exposed)[:, None] * np.array([values[0], values[1], 0.0])


HIDDEN = Hidden(
    family="physics", bodies=SOLIDS, quantities=components("draught", "xy", "1", 0.1, 0.5), draw=level, force=_force
)
