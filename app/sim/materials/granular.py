"""Grains: beans, rice, sand. They press and rub against each other, and do not pull.

After Drucker and Prager (1952) with the friction angle of Mohr and Coulomb, as in Klar et al. 2016 ("Drucker-Prager
elastoplasticity for sand animation"), without its singular values. Each bean stays a bean: one particle stands for it
from beginning to end, with its mass and volume; apart, beans bear no stress and keep no memory of their shape, and
remember how far they are apart up to loose packing, so that neither is a heap packed denser than spheres are, nor
does it swell by being moved. That holds for cells and not for pairs, which the grid does not see: swept into a heap,
half of the beans have a neighbour within half of their spacing at rest, as random points have.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false

from dataclasses import dataclass
from math import radians, sin, sqrt
from typing import Any, final

import warp as wp

from app.sim.constants import Matter
from app.sim.effect_composition import Hooks
from app.sim.effects.base import ParticleContext, WarpFunction
from app.sim.materials.base import LEAST_VOLUME, Law, deform, deviator, flow_plastically, lame_of, norm

LOOSE = wp.constant(1.16)
"""Relative volume beyond which grains forget how far they are apart: dense random packing of spheres holds 0.64 of
the volume, loose packing 0.55 (Scott 1960)."""


def _make(hooks: Hooks) -> WarpFunction:
    cohesion, kept = hooks["cohesion"], hooks["kept"]

    @wp.func
    def granular(m: Matter, E: float, C: wp.mat33, F: wp.mat33, grain: ParticleContext, phi: Any):
        mu = E * m.mu_per_stiffness
        bulk = E * m.lam_per_stiffness + 2.0 / 3.0 * mu
        tried = deform(C, F, grain.dt)
        J = wp.max(wp.determinant(tried), LEAST_VOLUME)
        b = tried * wp.transpose(tried)
        D = deviator(b)
        mean = wp.trace(b) / 3.0
        place = grain
        place.stress = mu * norm(D)
        strength = wp.max(0.0, cohesion(m.own[1], place, phi))
        # Of equal arguments, Warp gives the derivative to the second: without cohesion, grains apart have none.
        pressure = wp.max(-strength, -bulk * wp.log(J))
        bears = m.own[0] * wp.max(pressure, 0.0) + strength
        F_next = flow_plastically(tried, D, mean, kept(wp.min(1.0, bears / place.stress), place, phi))
        F_next = wp.pow(wp.min(1.0, LOOSE / J), 1.0 / 3.0) * F_next
        tau = mu * deviator(F_next * wp.transpose(F_next)) - pressure * wp.identity(n=3, dtype=float)
        return tau, F_next

    return granular


_LAW = Law(name="granular", make=_make)


@final
@dataclass(frozen=True, kw_only=True)
class Granular:
    """A heap's slope and its stickiness. Stiffness is that of the pile: low enough for the time step."""

    friction_angle_deg: float = 30.0
    cohesion_pa: float = 0.0
    poisson: float = 0.3
    viscosity_pa_s: float = 0.0
    law: Law = _LAW

    def lame(self) -> tuple[float, float]:
        """Mu and lambda per unit of stiffness."""
        return lame_of(self.poisson)

    def own(self) -> tuple[float, float, float, float]:
        """Deviatoric stress borne per pressure, matched to Mohr-Coulomb in compression; and the cohesion."""
        sine = sin(radians(self.friction_angle_deg))
        return (sqrt(2 / 3) * 6 * sine / (3 - sine), self.cohesion_pa, 0.0, 0.0)
