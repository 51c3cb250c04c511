"""Point constraint: a snag on the table holds what lies above it, by a drag of the rate k in a spot of 15 mm.

Implicit in the time step, so that no rate reverses a motion.
"""

from app.rig.simulated.injected_effects.base import (
    SOLIDS,
    Hidden,
    InjectedParameter,
    Moment,
    Values,
    Vectors,
    acting,
    where,
    with_random_place,
)

_WIDTH_M = 0.015


def _force(moment: Moment, values: Values) -> Vectors:
    square = ((moment.x[:, :2] - values[1:]) ** 2).sum(1) / _WIDTH_M**2
    rate = values[0] / (1.0 + square) ** 2
    return acting(moment, -(rate / (1.0 + rate * moment.period_s))[:, None] * moment.v)


HIDDEN = Hidden(
    family="physics",
    bodies=SOLIDS,
    quantities=(InjectedParameter(name="constraint_rate", unit="1/s", typical=125.0, high=830.0), *where("constraint")),
    draw=with_random_place,
    force=_force,
)
