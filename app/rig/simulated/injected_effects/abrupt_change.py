"""Abrupt change: between two pushes the table's friction and the object's stiffness change.

By the factors exp(a) and exp(b), each up or down; the values of the session's middle are the world's own. The stiffness
of a rope is that of its hinges, of beans that of their contacts.
"""

import numpy as np

from app.rig.simulated.injected_effects.base import SOLIDS, Factors, Hidden, InjectedParameter, Moment, Values


def _draw(size: float, rng: np.random.Generator) -> Values:
    return np.array([*(size * rng.choice([-1.0, 1.0], 2)), rng.uniform(-0.25, 0.25)])


def _step(moment: Moment, at: float) -> float:
    """State of the change now (0 or 1) less that in the middle of the session."""
    return float(moment.session > at) - float(at < 0)


def _friction(moment: Moment, values: Values) -> Factors:
    return np.full(len(moment.x), np.exp(values[0] * _step(moment, values[2])))


def _stiffness(moment: Moment, values: Values) -> Factors:
    return np.full(len(moment.x), np.exp(values[1] * _step(moment, values[2])))


HIDDEN = Hidden(
    family="physics",
    bodies=SOLIDS,
    quantities=(
        InjectedParameter(name="friction_step", unit="1", typical=0.5, high=1.0),
        InjectedParameter(name="stiffness_step", unit="1", typical=0.5, high=1.0),
        InjectedParameter(name="step_time", unit="session", low=-0.5, high=0.5),
    ),
    draw=_draw,
    friction=_friction,
    stiffness=_stiffness,
)
