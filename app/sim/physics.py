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

LEAST_TOUCH = wp.constant(1.0e-6)
"""Less than this share of a particle's mass is no contact."""

AXIS = wp.constant(1.0e-6)
"""Distances from the finger's axis are at least this [m]: on the axis there is no normal, and shall be no NaN."""

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
def finger_touch(k: Constants, x: wp.vec3, tip: wp.vec3) -> wp.vec4:
    """How a particle touches the finger, a cylinder above `tip`: (n_x, n_y, escape, 1) times the touching mass.

    n is the finger's horizontal normal, escape the speed [m/s] at which what is inside has to leave. A sigmoid of the
    distance says which share of the particle's mass touches. Distances are those of particles and not of nodes, where
    contact would begin a cell too early; the normal is level, because the table bears what a round tip presses down.
    """
    away = wp.vec2(x[0] - tip[0], x[1] - tip[1])
    distance = wp.sqrt(wp.dot(away, away) + AXIS * AXIS)
    gap = distance - k.finger_radius - k.contact_margin
    beside = _sigmoid(-gap / k.contact_width)
    level = _sigmoid((x[2] - tip[2] + k.contact_margin) / k.contact_width)
    escape = wp.clamp(-gap * k.contact_rate, 0.0, k.escape_speed)
    return (k.mass * beside * level) * wp.vec4(away[0] / distance, away[1] / distance, escape, 1.0)


@wp.func
def _sigmoid(a: float) -> float:
    return 1.0 / (1.0 + wp.exp(wp.clamp(-a, -30.0, 30.0)))


@wp.func
def finger_contact(k: Constants, v: wp.vec3, mass: float, touch: wp.vec4, tip_velocity: wp.vec3, friction: float):
    """A node's velocity after contact with the finger, given the sum of `finger_touch` over its particles.

    Approach is taken away in proportion to 1 - (1 - share)^4 of the touching share of the node's mass: a finger touches
    few particles, and a plain proportion would let the rest of a soft rope run through it.
    """
    result = v
    if touch[3] > LEAST_TOUCH * k.mass:
        n = wp.normalize(wp.vec3(touch[0], touch[1], 0.0))
        spared = 1.0 - wp.min(1.0, touch[3] / mass)
        relative = v - tip_velocity
        approach = wp.dot(relative, n)
        push = (1.0 - spared * spared * spared * spared) * wp.max(0.0, touch[2] / touch[3] - approach)
        tangential = relative - approach * n
        result = tip_velocity + (approach + push) * n + coulomb(tangential, push, friction, k.slip_speed)
    return result


@wp.func
def particle_forward(
    k: Constants,
    phi: Any,
    x: wp.vec3,
    v: wp.vec3,
    C: wp.mat33,
    F: wp.mat33,
    tip: wp.vec3,
):
    """What a particle gives to the grid: momentum [kg m/s], its affine part [kg/s], its touch; and its new F.

    The affine part holds the stress: A = -4 dt / cell^2 volume tau + m C (Hu et al. 2018, eq. 29 and Alg. 1).
    """
    F_next = F + k.dt * (C * F)
    mu = phi[STIFFNESS] * k.mu_per_stiffness
    lam = phi[STIFFNESS] * k.lam_per_stiffness
    tau = kirchhoff_stress(F_next, mu, lam)
    affine = (-4.0 * k.dt * k.per_cell * k.per_cell * k.volume) * tau + k.mass * C
    return k.mass * v, affine, finger_touch(k, x, tip), F_next


@wp.func
def particle_work(
    k: Constants,
    phi: Any,
    x: wp.vec3,
    v: wp.vec3,
    C: wp.mat33,
    F: wp.mat33,
    tip: wp.vec3,
    momentum_bar: wp.vec3,
    affine_bar: wp.mat33,
    touch_bar: wp.vec4,
    F_bar: wp.mat33,
) -> wp.float32:
    """The outputs of `particle_forward` times their cotangents: the gradient of this number is the adjoint."""
    momentum, affine, touch, F_next = particle_forward(k, phi, x, v, C, F, tip)
    return (
        wp.dot(momentum_bar, momentum) + wp.ddot(affine_bar, affine) + wp.dot(touch_bar, touch) + wp.ddot(F_bar, F_next)
    )


@wp.func
def table_contact(k: Constants, v: wp.vec3, x: wp.vec3, friction: float) -> wp.vec3:
    """A node's velocity after contact with the table: nodes at or below it cannot sink and feel Coulomb friction."""
    result = v
    if x[2] < 0.5 * k.cell:
        sinking = wp.max(0.0, -v[2])
        result = coulomb(wp.vec3(v[0], v[1], 0.0), sinking, friction, k.slip_speed) + wp.vec3(0.0, 0.0, v[2] + sinking)
    return result
