"""A viscous film on the table: drag -c m v on the parts near it, less with height and none from 2 cm up."""

import numpy as np

from app.rig.simulated.injected_effects.base import (
    SOLIDS,
    Hidden,
    InjectedParameter,
    Moment,
    Values,
    Vectors,
    acting,
    plain,
)

_REACH_M = 0.02


def _force(moment: Moment, values: Values) -> Vectors:
    near = np.clip(1.0 - moment.x[:, 2:] / _REACH_M, 0.0, 1.0)
    return acting(moment, -values[0] * near * moment.v)


HIDDEN = Hidden(
    family="physics",
    bodies=SOLIDS,
    quantities=(InjectedParameter(name="film_drag", unit="1/s", typical=4.17, high=20.0),),
    draw=plain,
    force=_force,
)
