"""Rope: fibres in its core that do not stretch, in matter that bends, yields, and keeps its bend.

One modulus cannot say that: a rope resists tension hundreds of times as much as an elastic rod that bends as easily. So
fibres of their own carry the tension, transversely isotropic as in Weiss, Maker and Govindjee 1996, "Finite element
implementation of incompressible, transversely isotropic hyperelasticity" (their stress acts along F t alone, and only
when stretched), near the middle line, where bending strains nothing. The matter around them is elasto-plastic after von
Mises, and flow leaves the fibres' stretch as it is.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportOperatorIssue=false

from dataclasses import dataclass
from math import sqrt
from typing import Any, final

import warp as wp

from app.sim.constants import Matter
from app.sim.effect_composition import Hooks
from app.sim.effects.base import ParticleContext, WarpFunction
from app.sim.materials.base import Law, deform, kirchhoff_stress, lame_of, relaxation

_LEAST = wp.constant(1.0e-6)
"""Regularisation of a fibre's length: without fibres (direction unknown, 0) the law must not give NaN."""


def _make(hooks: Hooks) -> WarpFunction:
    rest, relaxed = hooks["rest"], relaxation(hooks)

    @wp.func
    def rope(m: Matter, E: float, C: wp.mat33, F: wp.mat33, grain: ParticleContext, phi: Any):
        mu = E * m.mu_per_stiffness
        along = wp.vec3(grain.label[2], grain.label[3], 0.0)
        out = grain.label[1] / m.own[1]
        core = wp.exp(-out * out)
        F_next = deform(C, F, grain.dt)
        stretched = wp.length(F_next * along)
        F_next = relaxed(F_next, mu, m.own[2] / E, grain, phi)
        fibre = F_next * along
        F_next = F_next + (core * (stretched / (wp.length(fibre) + _LEAST) - 1.0)) * wp.outer(fibre, along)
        fibre = F_next * along
        stretch = wp.length(fibre) + _LEAST
        tension = core * m.own[0] * wp.max(0.0, stretch - 1.0) / stretch
        matter = kirchhoff_stress(rest(F_next, grain, phi), mu, E * m.lam_per_stiffness)
        return matter + tension * wp.outer(fibre, fibre), F_next

    return rope


_LAW = Law(name="rope", make=_make, directed=True)


@final
@dataclass(frozen=True, kw_only=True)
class RopeMaterial:
    """Fibres of `fibre_pa` within about `core_m` of the middle line; the rest yields at the uniaxial `yield_strain`.

    Young's modulus of the rest, and with it the moment at which the rope yields, is phi's `stiffness`, times the body's
    share of it.
    """

    fibre_pa: float
    core_m: float
    yield_strain: float
    poisson: float = 0.2
    viscosity_pa_s: float = 0.0
    law: Law = _LAW

    def lame(self) -> tuple[float, float]:
        """Mu and lambda per unit of stiffness."""
        return lame_of(self.poisson)

    def own(self) -> tuple[float, float, float, float]:
        """Fibres, core, and the softness of the rest times Young's modulus."""
        return (self.fibre_pa, self.core_m, 1.0 / (sqrt(2 / 3) * self.yield_strain), 0.0)
