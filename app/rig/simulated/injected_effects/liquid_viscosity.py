"""Liquid viscosity: the liquid is thicker than water, by so many Pa s."""

from app.rig.simulated.injected_effects.base import LIQUIDS, Hidden, InjectedParameter, plain

HIDDEN = Hidden(
    family="physics",
    bodies=LIQUIDS,
    quantities=(InjectedParameter(name="liquid_viscosity", unit="Pa s", typical=2.0, high=10.0),),
    draw=plain,
)
