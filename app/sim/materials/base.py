"""Interface of a material: numbers, and a constitutive law."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportInvalidTypeForm=false

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, final

import warp as wp

from app.sim.effect_composition import Hooks
from app.sim.effects.base import ParticleContext, WarpFunction

LEAST_VOLUME = wp.constant(0.1)
"""The pressure stops growing below this relative volume, where a logarithm would end in NaN."""

TINY = wp.constant(1.0e-12)
"""Keeps the derivative of a norm finite at zero strain."""


@final
@dataclass(frozen=True, kw_only=True)
class Law:
    """Constitutive law, as code.

    `make(hooks)` is the Warp function `law(m, E, C, F, grain, phi) -> tau, F`: the Kirchhoff stress [Pa] and the
    deformation after a substep with velocity gradient C [1/s], for Young's modulus E [Pa]. The law defines what F
    means, but its determinant is the relative volume. `directed`: particles' directions (`state.Setting.label`) matter.
    """

    name: str
    make: Callable[[Hooks], WarpFunction]
    fluid: bool = False
    directed: bool = False


class Material(Protocol):
    """A law and its numbers."""

    @property
    def law(self) -> Law:
        """Constitutive law that is compiled."""
        ...

    @property
    def viscosity_pa_s(self) -> float:
        """Newtonian, of the material at rest."""
        ...

    def lame(self) -> tuple[float, float]:
        """Mu and lambda per unit of stiffness."""
        ...

    def own(self) -> tuple[float, float, float, float]:
        """Numbers for `Matter.own`, as its law reads them."""
        ...


def lame_of(poisson: float) -> tuple[float, float]:
    """Mu and lambda per unit of Young's modulus."""
    return 0.5 / (1.0 + poisson), poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))


@wp.func
def deform(C: wp.mat33, F: wp.mat33, dt: float) -> wp.mat33:
    """F after a substep: (I + dt C) F."""
    return F + dt * (C * F)


@wp.func
def kirchhoff_stress(F: wp.mat33, mu: float, lam: float) -> wp.mat33:
    """Neo-Hookean Kirchhoff stress [Pa], tau = mu (F F^T - I) + lam log(J) I: no singular values needed."""
    J = wp.max(wp.determinant(F), LEAST_VOLUME)
    identity = wp.identity(n=3, dtype=float)
    return mu * (F * wp.transpose(F) - identity) + lam * wp.log(J) * identity


@wp.func
def deviator(b: wp.mat33) -> wp.mat33:
    """Deviator of a tensor: b - tr(b) / 3 I."""
    return b - (wp.trace(b) / 3.0) * wp.identity(n=3, dtype=float)


@wp.func
def norm(a: wp.mat33) -> float:
    """Frobenius norm, with a derivative at zero."""
    return wp.sqrt(wp.ddot(a, a) + TINY)


@wp.func
def flow_plastically(F: wp.mat33, D: wp.mat33, mean: float, keep: float) -> wp.mat33:
    """F after plastic flow that keeps the share `keep` of the deviator D of F F^T, whose trace is 3 `mean`.

    Radial return (Simo and Hughes 1998, box 9.1) to first order in the step, F <- (I - (1 - keep) / (2 mean) D) F, so
    that no singular values are needed; what is left over flows in the next substep. Volume stays: what the second
    order takes of it, in every substep, would leave nothing of what flows for long.
    """
    part = (1.0 - keep) / (2.0 * mean)
    volume = 1.0 - part * part * (0.5 * wp.ddot(D, D) + part * wp.determinant(D))
    return wp.pow(wp.max(volume, LEAST_VOLUME), -1.0 / 3.0) * (F - part * (D * F))


def relaxation(hooks: Hooks) -> WarpFunction:
    """`relaxed(F, mu, softness, grain, phi)`: F after the flow that yield and effects ask for.

    `softness` [1/Pa] is one over the norm of the deviatoric Kirchhoff stress that the material bears; 0: any.
    """
    kept = hooks["kept"]

    @wp.func
    def relaxed(F: wp.mat33, mu: float, softness: float, grain: ParticleContext, phi: Any) -> wp.mat33:
        b = F * wp.transpose(F)
        D = deviator(b)
        place = grain
        place.stress = mu * norm(D)
        keep = kept(1.0 / wp.max(1.0, place.stress * softness), place, phi)
        return flow_plastically(F, D, wp.trace(b) / 3.0, keep)

    return relaxed
