"""Permanent set: the share of its bends that a rope keeps without load; the rest springs back (springback).

Linear kinematic hardening (Prager 1956, "A new method of analyzing stresses and strains in work-hardening plastic
solids"): bent by q at the centre of its elastic range, a rope of bending rigidity B bears B (1 - s) q, and yields about
that. The tangent beyond yield is B (1 - s). With s = 1, the null, all bends last, as in perfect plasticity; with s = 0
it is elastic, and straight without load. A rope that is seen is taken to be at the centre. For rods alone.
"""

from app.sim.effects.base import Effect
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import EffectParameters, RodContext, RodEffect, RodProperties


def set_rods(rods: RodProperties, _context: RodContext, phi: EffectParameters) -> RodProperties:
    """The share that lasts of the bends of rods."""
    return rods._replace(permanent_set=rods.permanent_set * phi[:, 0])


EFFECT = Effect(
    parameters=(
        ParameterSpec(
            name="permanent_set",
            unit="1",
            nominal=1.0,
            low=0.0,
            high=1.0,
            typical=0.75,
            scale="linear",
            about="Share of its bends that the unloaded object keeps; the rest springs back.",
        ),
    ),
    catalogued=False,
    rod=RodEffect(properties=set_rods),
)
