"""Kelvin-Voigt solid: a viscosity eta damps the rope's hinges.

A fibre stretched at the rate e bears the stress 3 eta e (Trouton 1906, "On the coefficient of viscous traction"), so a
hinge between segments of length L has the damping 3 eta I / L, I = pi r^4 / 4.
"""

from dataclasses import replace
from math import pi

from app.core.geometry.scene_description import Body, Rope
from app.rig.simulated.injected_effects.base import ROPES, Hidden, InjectedParameter, Values, plain
from app.rig.simulated.worlds.physics import WorldPhysics


def _physics(physics: WorldPhysics, rope: Body, values: Values) -> WorldPhysics:
    assert isinstance(rope, Rope)
    own = physics.rope
    damping = float(3 * values[0] * pi * rope.radius_m**4 / 4 / (rope.length_m / own.segments))
    return replace(
        physics,
        rope=replace(
            own,
            bend_damping_n_m_s_rad=own.bend_damping_n_m_s_rad + damping,
            lift_damping_n_m_s_rad=own.lift_damping_n_m_s_rad + damping,
        ),
    )


HIDDEN = Hidden(
    family="physics",
    bodies=ROPES,
    quantities=(InjectedParameter(name="solid_viscosity", unit="Pa s", typical=4.17, high=8.3),),
    draw=plain,
    physics=_physics,
)
