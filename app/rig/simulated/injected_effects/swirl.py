"""Swirl: everything is carried round a point of the table, by the acceleration s n x (x - c), in either sense.

Not in the catalogue; a turntable's creep or a stirred film would look like this. Beans bear 1 m/s^2 before they roll.
"""

import numpy as np

from app.rig.simulated.injected_effects.base import (
    SOLIDS,
    Hidden,
    InjectedParameter,
    Moment,
    Values,
    Vectors,
    acting,
    signed_placed,
    where,
)


def _force(moment: Moment, values: Values) -> Vectors:
    away = moment.x[:, :2] - values[1:]
    return acting(moment, values[0] * np.column_stack([-away[:, 1], away[:, 0], np.zeros(len(away))]))


HIDDEN = Hidden(
    family="physics",
    bodies=SOLIDS,
    catalogued=False,
    beans_share=0.2,
    quantities=(InjectedParameter(name="swirl", unit="1/s^2", typical=8.0, high=20.0), *where("swirl")),
    draw=signed_placed,
    force=_force,
)
