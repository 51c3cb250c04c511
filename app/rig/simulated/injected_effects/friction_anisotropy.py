"""Anisotropic friction: 1 + a cos 2 phi + b sin 2 phi times its own in the direction phi of sliding."""

import numpy as np

from app.rig.simulated.injected_effects.base import ON_TABLES, Factors, Hidden, InjectedParameter, Moment, Values, level

_REST_M_S = 1e-3
"""Regularisation of the direction: a body slower than about this slides in none."""


def _friction(moment: Moment, values: Values) -> Factors:
    vx, vy = moment.v[:, 0], moment.v[:, 1]
    square = vx**2 + vy**2 + _REST_M_S**2
    return np.maximum(0.0, 1.0 + values[0] * (vx**2 - vy**2) / square + values[1] * 2 * vx * vy / square)


HIDDEN = Hidden(
    family="physics",
    bodies=ON_TABLES,
    quantities=tuple(
        InjectedParameter(name=f"anisotropy_{name}", unit="1", typical=0.2, high=0.6) for name in ("axes", "diagonals")
    ),
    draw=level,
    friction=_friction,
)
