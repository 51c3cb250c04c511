"""Stribeck effect: friction at rest is 1 + r times that of fast sliding, with a Gaussian transition.

The speed at which the excess falls to a third is drawn near the typical one.
"""

import numpy as np

from app.rig.simulated.injected_effects.base import ON_TABLES, Factors, Hidden, InjectedParameter, Moment, Values

_SPEED_M_S = 0.06


def _draw(size: float, rng: np.random.Generator) -> Values:
    return np.array([size, _SPEED_M_S * np.exp(rng.uniform(-0.5, 1.0))])


def _friction(moment: Moment, values: Values) -> Factors:
    square = (moment.v[:, :2] ** 2).sum(1)
    return 1.0 + values[0] * np.exp(-square / values[1] ** 2)


HIDDEN = Hidden(
    family="physics",
    bodies=ON_TABLES,
    quantities=(
        InjectedParameter(name="stribeck_excess", unit="1", typical=0.4, high=2.0),
        InjectedParameter(name="stribeck_speed", unit="m/s", null=_SPEED_M_S),
    ),
    draw=_draw,
    friction=_friction,
)
