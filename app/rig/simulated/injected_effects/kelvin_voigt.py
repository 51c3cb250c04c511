"""Kelvin-Voigt solid: a viscosity eta damps the rope's hinges.

A fibre stretched at the rate e bears the stress 3 eta e (Trouton 1906, "On the coefficient of viscous traction"), so a
hinge between segments of length L has the damping 3 eta I / L, I = pi r^4 / 4.
"""

from dataclasses import replace
from math import pi
from typing import TYPE_CHECKING

from app.rig.simulated.injected_effects.base import Hidden, InjectedParameter, Values, plain
from app.rig.simulated.worlds.physics import WorldPhysics

if TYPE_CHECKING:
    from app.core.geometry.scene_description import Rope


def _physics(physics: WorldPhysics, rope: "Rope", values: Values) -> WorldPhysics:
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
    quantities=(InjectedParameter(name="solid_viscosity", unit="Pa s", typical=4.17, high=8.3),),
    draw=plain,
    physics=_physics,
)
