"""Mass heterogeneity: the rope's segments are exp(h1 s + h2 (3 s^2) / 2) times as heavy, s from -1 to 1 along it."""

from typing import Any

import numpy as np

from app.rig.simulated.injected_effects.base import ROPES, Hidden, InjectedParameter, Values, level
from app.rig.simulated.worlds.physics import WorldPhysics


def _build(spec: Any, physics: WorldPhysics, values: Values) -> None:
    count = physics.rope.segments
    for index in range(count):
        s = (2 * index + 1) / count - 1
        share = np.exp(values[0] * s + 1.5 * values[1] * s * s)
        body = spec.body(f"rope{index}")
        body.mass = body.mass * share
        body.inertia = body.inertia * share


HIDDEN = Hidden(
    family="physics",
    bodies=ROPES,
    quantities=(
        InjectedParameter(name="mass_slope", unit="1", typical=0.35, high=0.7),
        InjectedParameter(name="mass_bow", unit="1", typical=0.25, high=0.5),
    ),
    draw=level,
    build=_build,
)
