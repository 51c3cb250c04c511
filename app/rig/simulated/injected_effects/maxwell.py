"""Maxwell solid: the elastic bend of the rope's hinges becomes permanent at the rate r, under load or not."""

import numpy as np

from app.rig.simulated.injected_effects.base import ROPES, Hidden, InjectedParameter, Values, plain


def _relaxed_share(period_s: float, values: Values) -> float:
    return float(-np.expm1(-values[0] * period_s))


HIDDEN = Hidden(
    family="physics",
    bodies=ROPES,
    quantities=(InjectedParameter(name="relaxation_rate", unit="1/s", typical=1.0, high=10.0),),
    draw=plain,
    relaxed=_relaxed_share,
)
