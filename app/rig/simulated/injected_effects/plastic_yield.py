"""Plastic yield: the rope's hinges bend permanently beyond a stress of 1 / c, where that is below their own limit.

A rod of stiffness E bent to the curvature k has the stress E k r at its surface, whose deviatoric norm is sqrt(2/3) of
it. E is the world's own, from the stiffness K of its hinges: E I = K L.
"""

from dataclasses import replace
from math import pi, sqrt

from app.core.geometry.scene_description import Body, Rope
from app.rig.simulated.injected_effects.base import ROPES, Hidden, InjectedParameter, Values, plain
from app.rig.simulated.worlds.physics import WorldPhysics


def _physics(physics: WorldPhysics, rope: Body, values: Values) -> WorldPhysics:
    assert isinstance(rope, Rope)
    if values[0] == 0:
        return physics
    own, length_m = physics.rope, rope.length_m / physics.rope.segments
    E = own.bend_stiffness_n_m_rad * length_m / (pi * rope.radius_m**4 / 4)
    bend = length_m / (sqrt(2 / 3) * E * rope.radius_m * float(values[0]))
    return replace(physics, rope=replace(own, bend_yield_rad=min(own.bend_yield_rad, bend)))


HIDDEN = Hidden(
    family="physics",
    bodies=ROPES,
    quantities=(InjectedParameter(name="yield_softness", unit="1/Pa", typical=0.012, high=0.06),),
    draw=plain,
    physics=_physics,
)
