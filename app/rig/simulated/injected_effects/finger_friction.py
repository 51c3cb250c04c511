"""Finger friction: the tool's Coulomb coefficient, of finger, paddle or bowls, differs from that of a polished one."""

from dataclasses import replace

from app.core.geometry.scene_description import Body
from app.rig.simulated.injected_effects.base import ON_TABLES_OR_POURED, Hidden, InjectedParameter, Values, plain
from app.rig.simulated.worlds.physics import WorldPhysics


def _physics(physics: WorldPhysics, _body: Body, values: Values) -> WorldPhysics:
    return replace(physics, finger_friction=float(values[0]))


HIDDEN = Hidden(
    family="physics",
    bodies=ON_TABLES_OR_POURED,
    quantities=(InjectedParameter(name="finger_friction", unit="1", null=0.3, typical=0.6, low=0.01, high=1.5),),
    draw=plain,
    physics=_physics,
)
