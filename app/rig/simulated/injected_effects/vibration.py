"""Vibration: the table's friction oscillates, 1 + a sin(2 pi f t) times its own, a few times a second.

Not in the catalogue: a machine runs in the same room.
"""

import numpy as np

from app.rig.simulated.injected_effects.base import SOLIDS, Factors, Hidden, InjectedParameter, Moment, Values


def _draw(size: float, rng: np.random.Generator) -> Values:
    return np.array([size, rng.uniform(0.8, 2.5)])


def _friction(moment: Moment, values: Values) -> Factors:
    return np.full(len(moment.x), 1.0 + values[0] * np.sin(2 * np.pi * values[1] * moment.time_s))


HIDDEN = Hidden(
    family="physics",
    bodies=SOLIDS,
    catalogued=False,
    quantities=(
        InjectedParameter(name="vibration", unit="1", typical=0.5, high=0.9),
        InjectedParameter(name="vibration_frequency", unit="Hz"),
    ),
    draw=_draw,
    friction=_friction,
)
