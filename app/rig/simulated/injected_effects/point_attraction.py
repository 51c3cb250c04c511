"""Point attraction: a magnet under the table pulls with up to the share A of weight, most at 5 cm from it.

The sign is random: it may repel.
"""

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

_WIDTH_M = 0.05


def _force(moment: Moment, values: Values) -> Vectors:
    to = values[1:] - moment.x[:, :2]
    field = 2 * _WIDTH_M / ((to**2).sum(1) + _WIDTH_M**2)
    pull = acting(moment, moment.x * 0.0)
    pull[:, :2] = values[0] * moment.gravity_m_s2 * (moment.mass * field)[:, None] * to
    return pull


HIDDEN = Hidden(
    family="physics",
    bodies=SOLIDS,
    quantities=(InjectedParameter(name="attraction", unit="1", typical=0.1, high=0.5), *where("attraction")),
    draw=signed_placed,
    force=_force,
)
