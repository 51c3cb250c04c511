"""Elasto-plastic after von Mises: dough, clay, wire. Elastic up to a yield stress, and then it flows and stays."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportArgumentType=false, reportCallIssue=false

from dataclasses import dataclass
from math import sqrt
from typing import Any, final

import warp as wp

from app.sim.constants import Matter
from app.sim.effect_composition import Hooks
from app.sim.effects.base import ParticleContext, WarpFunction
from app.sim.materials.base import Law, deform, kirchhoff_stress, lame_of, relaxation


def _make(hooks: Hooks) -> WarpFunction:
    rest, relaxed = hooks["rest"], relaxation(hooks)

    @wp.func
    def plastic(m: Matter, E: float, C: wp.mat33, F: wp.mat33, grain: ParticleContext, phi: Any):
        mu = E * m.mu_per_stiffness
        F_next = relaxed(deform(C, F, grain.dt), mu, m.own[0], grain, phi)
        return kirchhoff_stress(rest(F_next, grain, phi), mu, E * m.lam_per_stiffness), F_next

    return plastic


_LAW = Law(name="plastic", make=_make)


@final
@dataclass(frozen=True, kw_only=True)
class Plastic:
    """Yields at the uniaxial stress `yield_pa`: the norm of the deviatoric stress is then sqrt(2/3) of it."""

    yield_pa: float
    poisson: float = 0.2
    viscosity_pa_s: float = 0.0
    law: Law = _LAW

    def lame(self) -> tuple[float, float]:
        """Mu and lambda per unit of stiffness."""
        return lame_of(self.poisson)

    def own(self) -> tuple[float, float, float, float]:
        """The softness: one over the largest norm of the deviatoric stress."""
        return (1.0 / (sqrt(2 / 3) * self.yield_pa), 0.0, 0.0, 0.0)
