"""Finger friction: the finger's Coulomb coefficient differs from that of a polished finger."""

from dataclasses import replace
from typing import TYPE_CHECKING

from app.rig.simulated.injected_effects.base import Hidden, InjectedParameter, Values, plain
from app.rig.simulated.worlds.physics import WorldPhysics

if TYPE_CHECKING:
    from app.core.geometry.scene_description import Rope


def _physics(physics: WorldPhysics, _rope: "Rope", values: Values) -> WorldPhysics:
    return replace(physics, finger_friction=float(values[0]))


HIDDEN = Hidden(
    family="physics",
    quantities=(InjectedParameter(name="finger_friction", unit="1", null=0.3, typical=0.6, low=0.01, high=1.5),),
    draw=plain,
    physics=_physics,
)
