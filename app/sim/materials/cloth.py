"""Cloth: thin, resists stretch and shear, bends easily. A codimensional material (Jiang et al. 2017).

The first two columns of F are the cloth's two threads, as they lie now; stress comes from their lengths and angle
alone (St. Venant-Kirchhoff membrane), so that bending is free. The third is its normal, which follows the threads.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false

from dataclasses import dataclass
from typing import Any, final

import warp as wp

from app.sim.constants import Matter
from app.sim.effect_composition import Hooks
from app.sim.effects.base import ParticleContext, WarpFunction
from app.sim.materials.base import Law, deform


def _make(hooks: Hooks) -> WarpFunction:
    del hooks

    @wp.func
    def cloth(m: Matter, E: float, C: wp.mat33, F: wp.mat33, grain: ParticleContext, _phi: Any):
        mu = E * m.mu_per_stiffness
        lam = E * m.lam_per_stiffness
        grown = deform(C, F, grain.dt)
        warp = wp.vec3(grown[0, 0], grown[1, 0], grown[2, 0])
        weft = wp.vec3(grown[0, 1], grown[1, 1], grown[2, 1])
        along = 0.5 * (wp.dot(warp, warp) - 1.0)
        across = 0.5 * (wp.dot(weft, weft) - 1.0)
        shear = 0.5 * wp.dot(warp, weft)
        area = lam * (along + across)
        # Compression buckles a cloth long before it is felt: only a share of it is resisted.
        s_along = area + 2.0 * mu * along
        s_across = area + 2.0 * mu * across
        s_along = wp.max(s_along, m.own[0] * s_along)
        s_across = wp.max(s_across, m.own[0] * s_across)
        s_shear = 2.0 * mu * m.own[1] * shear
        tau = (
            s_along * wp.outer(warp, warp)
            + s_across * wp.outer(weft, weft)
            + s_shear * (wp.outer(warp, weft) + wp.outer(weft, warp))
        )
        normal = wp.normalize(wp.cross(warp, weft))
        return tau, wp.matrix_from_cols(warp, weft, normal)

    return cloth


_LAW = Law(name="cloth", make=_make)


@final
@dataclass(frozen=True, kw_only=True)
class ClothMaterial:
    """`buckling`: share of compression that is resisted; `shear`: shear stiffness over that of an isotropic sheet."""

    poisson: float = 0.2
    buckling: float = 0.05
    shear: float = 0.3
    viscosity_pa_s: float = 0.0
    law: Law = _LAW

    def lame(self) -> tuple[float, float]:
        """Mu and lambda of plane stress, per unit of stiffness."""
        return 0.5 / (1 + self.poisson), self.poisson / (1 - self.poisson**2)

    def own(self) -> tuple[float, float, float, float]:
        """Shares of compression and shear."""
        return (self.buckling, self.shear, 0.0, 0.0)
