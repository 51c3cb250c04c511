"""Elastic: ropes, rods, tofu and, stiff enough, nearly rigid bodies. Neo-Hookean."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportArgumentType=false, reportCallIssue=false

from dataclasses import dataclass
from typing import Any, final

import warp as wp

from app.sim.constants import Matter
from app.sim.effect_composition import Hooks
from app.sim.effects.base import ParticleContext, WarpFunction
from app.sim.materials.base import Law, deform, kirchhoff_stress, lame_of, relaxation


def _make(hooks: Hooks) -> WarpFunction:
    rest, relaxed, flows = hooks["rest"], relaxation(hooks), hooks.acts("kept")

    @wp.func
    def elastic(m: Matter, E: float, C: wp.mat33, F: wp.mat33, grain: ParticleContext, phi: Any):
        mu = E * m.mu_per_stiffness
        F_next = deform(C, F, grain.dt)
        if flows(grain, phi):
            F_next = relaxed(F_next, mu, 0.0, grain, phi)
        return kirchhoff_stress(rest(F_next, grain, phi), mu, E * m.lam_per_stiffness), F_next

    return elastic


_LAW = Law(name="elastic", make=_make)


@final
@dataclass(frozen=True, kw_only=True)
class Elastic:
    """Young's modulus is phi's `stiffness`, times the body's share of it."""

    poisson: float = 0.2
    viscosity_pa_s: float = 0.0
    law: Law = _LAW

    def lame(self) -> tuple[float, float]:
        """Mu and lambda per unit of stiffness."""
        return lame_of(self.poisson)

    def own(self) -> tuple[float, float, float, float]:
        """Further numbers of the law: none."""
        return (0.0, 0.0, 0.0, 0.0)
