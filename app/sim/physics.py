"""The physics of one particle and of one grid node, as Warp functions of registers: Warp differentiates these.

The method is MLS-MPM (Hu et al. 2018, "A Moving Least Squares Material Point Method"), with APIC transfers (Jiang et
al. 2015); letters as there: x v C F, mu lam, tau the Kirchhoff stress.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false

from typing import Any

import warp as wp

from app.sim.constants import Constants

STIFFNESS = wp.constant(0)
TABLE_FRICTION = wp.constant(1)
FINGER_FRICTION = wp.constant(2)
"""Columns of phi, in the order of `params.NOMINAL_PHYSICS`."""

LEAST_VOLUME = wp.constant(0.1)
"""The pressure stops growing below this relative volume, where a logarithm would end in NaN."""


@wp.func
def kirchhoff_stress(F: wp.mat33, mu: float, lam: float) -> wp.mat33:
    """Neo-Hookean Kirchhoff stress [Pa], tau = mu (F F^T - I) + lam log(J) I: no singular values needed."""
    J = wp.max(wp.determinant(F), LEAST_VOLUME)
    identity = wp.identity(n=3, dtype=float)
    return mu * (F * wp.transpose(F) - identity) + lam * wp.log(J) * identity


@wp.func
def coulomb(tangential: wp.vec3, normal_impulse: float, friction: float, slip_speed: float) -> wp.vec3:
    """What is left of a tangential velocity [m/s] after friction with the given normal velocity change [m/s].

    |v| is smoothed by `slip_speed`, so that the derivative at rest is finite.
    """
    speed = wp.sqrt(wp.dot(tangential, tangential) + slip_speed * slip_speed)
    return wp.max(0.0, 1.0 - friction * normal_impulse / speed) * tangential


@wp.func
def finger_contact(
    k: Constants, x: wp.vec3, v: wp.vec3, tip: wp.vec3, tip_velocity: wp.vec3, friction: float
) -> wp.vec3:
    """A particle's velocity [m/s] after contact with the finger, a vertical capsule above `tip`.

    A sigmoid of the signed distance says how much of the approaching velocity is taken away; what is inside is moved
    out within `contact_time_s`.
    """
    foot = wp.clamp(x[2], tip[2] + k.finger_radius, tip[2] + k.finger_length)
    away = x - wp.vec3(tip[0], tip[1], foot)
    distance = wp.sqrt(wp.dot(away, away) + 1.0e-12)  # [m]; a particle on the axis has no normal, and no NaN
    n = away / distance
    gap = distance - k.finger_radius - k.contact_margin
    touch = 1.0 / (1.0 + wp.exp(wp.clamp(gap / k.contact_width, -30.0, 30.0)))
    relative = v - tip_velocity
    approach = wp.dot(relative, n)
    push = touch * wp.max(0.0, wp.max(0.0, -gap) * k.contact_rate - approach)
    tangential = relative - approach * n
    return tip_velocity + (approach + push) * n + coulomb(tangential, push, friction, k.slip_speed)


@wp.func
def particle_forward(
    k: Constants,
    phi: Any,
    x: wp.vec3,
    v: wp.vec3,
    C: wp.mat33,
    F: wp.mat33,
    tip: wp.vec3,
    tip_velocity: wp.vec3,
):
    """What a particle gives to the grid: momentum [kg m/s], its affine part [kg/s], and its new F.

    The affine part holds the stress: A = -4 dt / cell^2 volume tau + m C (Hu et al. 2018, eq. 29 and Alg. 1).
    """
    touched = finger_contact(k, x, v, tip, tip_velocity, phi[FINGER_FRICTION])
    F_next = F + k.dt * (C * F)
    mu = phi[STIFFNESS] * k.mu_per_stiffness
    lam = phi[STIFFNESS] * k.lam_per_stiffness
    tau = kirchhoff_stress(F_next, mu, lam)
    affine = (-4.0 * k.dt * k.per_cell * k.per_cell * k.volume) * tau + k.mass * C
    return k.mass * touched, affine, F_next


@wp.func
def particle_work(
    k: Constants,
    phi: Any,
    x: wp.vec3,
    v: wp.vec3,
    C: wp.mat33,
    F: wp.mat33,
    tip: wp.vec3,
    tip_velocity: wp.vec3,
    momentum_bar: wp.vec3,
    affine_bar: wp.mat33,
    F_bar: wp.mat33,
) -> wp.float32:
    """The outputs of `particle_forward` times their cotangents: the gradient of this number is the adjoint."""
    momentum, affine, F_next = particle_forward(k, phi, x, v, C, F, tip, tip_velocity)
    return wp.dot(momentum_bar, momentum) + wp.ddot(affine_bar, affine) + wp.ddot(F_bar, F_next)


@wp.func
def table_contact(k: Constants, v: wp.vec3, x: wp.vec3, friction: float) -> wp.vec3:
    """A node's velocity after contact with the table: nodes at or below it cannot sink and feel Coulomb friction."""
    result = v
    if x[2] < 0.5 * k.cell:
        sinking = wp.max(0.0, -v[2])
        result = coulomb(wp.vec3(v[0], v[1], 0.0), sinking, friction, k.slip_speed) + wp.vec3(0.0, 0.0, v[2] + sinking)
    return result
