"""Shear thinning: the liquid's viscosity goes with the shear rate to the power n - 1, and is its own at 10 1/s."""

from app.rig.simulated.injected_effects.base import LIQUIDS, Hidden, InjectedParameter, plain

HIDDEN = Hidden(
    family="physics",
    bodies=LIQUIDS,
    quantities=(InjectedParameter(name="flow_index", unit="1", null=1.0, typical=0.6, low=0.3, high=1.5),),
    draw=plain,
)
