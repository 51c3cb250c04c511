"""Stiffness heterogeneity: the rope's hinges are exp(h1 s + h2 (3 s^2) / 2) times as stiff, s from -1 to 1 along it."""

import numpy as np

from app.rig.simulated.injected_effects.base import ROPES, Factors, Hidden, InjectedParameter, Moment, Values, level


def _stiffness(moment: Moment, values: Values) -> Factors:
    # A hinge stands where its segment begins.
    s = 2 * np.arange(len(moment.x)) / len(moment.x) - 1
    return np.exp(values[0] * s + 1.5 * values[1] * s * s)


HIDDEN = Hidden(
    family="physics",
    bodies=ROPES,
    quantities=(
        InjectedParameter(name="stiffness_slope", unit="1", typical=0.5, high=1.0),
        InjectedParameter(name="stiffness_bow", unit="1", typical=0.4, high=0.7),
    ),
    draw=level,
    stiffness=_stiffness,
)
