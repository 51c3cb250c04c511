"""Contact: what tools do to particles and, through them, to grid nodes; and the table, as Warp functions.

A particle near a tool tells the nodes around it the tool's normal, velocity and friction. Distances are those of
particles and not of nodes, where contact would begin a cell too early and a thin wall would have no sides.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false

import warp as wp

from app.sim.constants import Constants

LEAST_TOUCH = wp.constant(1.0e-6)
"""Less than this share of a particle's mass is no contact."""

FAR = wp.constant(15.0)
"""Beyond this many widths of the contact's sigmoid the share is below LEAST_TOUCH."""


@wp.func
def coulomb(tangential: wp.vec3, normal_impulse: float, friction: float, slip_speed: float) -> wp.vec3:
    """Tangential velocity [m/s] left after Coulomb friction with the given normal velocity change [m/s].

    |v| is smoothed by `slip_speed`, so that the derivative at rest is finite.
    """
    speed = wp.sqrt(wp.dot(tangential, tangential) + slip_speed * slip_speed)
    return wp.max(0.0, 1.0 - friction * normal_impulse / speed) * tangential


@wp.func
def sigmoid(a: float) -> float:
    """1 / (1 + e^-a), without overflow."""
    return 1.0 / (1.0 + wp.exp(wp.clamp(-a, -30.0, 30.0)))


@wp.func
def table_contact(k: Constants, v: wp.vec3, friction: float) -> wp.vec3:
    """The velocity of a node at or below the table after contact: it cannot sink, and feels Coulomb friction."""
    sinking = wp.max(0.0, -v[2])
    return coulomb(wp.vec3(v[0], v[1], 0.0), sinking, friction, k.slip_speed) + wp.vec3(0.0, 0.0, v[2] + sinking)


@wp.func
def touch_share(k: Constants, gap: float) -> float:
    """Share of a particle's mass that touches a tool whose surface is `gap` [m] away."""
    return sigmoid(-gap / k.contact_width)


@wp.func
def touch_aim(k: Constants, gap: float, n: wp.vec3, velocity: wp.vec3) -> wp.vec3:
    """The velocity [m/s] that touching matter must not fall short of along n: the tool's, and out of it if inside."""
    return velocity + wp.clamp(-gap * k.contact_rate, 0.0, k.escape_speed) * n


@wp.func
def tool_contact(k: Constants, v: wp.vec3, mass: float, touch: wp.vec4, aim: wp.vec4, adhesion: float) -> wp.vec3:
    """A node's velocity after contact with tools, given the sums of touch (n, 1) and aim (velocity, friction).

    Approach is taken away in proportion to 1 - (1 - share)^4 of the touching share of the node's mass: a tool touches
    few particles, and a plain proportion would let the rest of a soft rope run through it. `adhesion` [Pa] holds a
    node's face back that leaves.
    """
    result = v
    if touch[3] > LEAST_TOUCH * k.least_mass:
        n = wp.normalize(wp.vec3(touch[0], touch[1], touch[2]))
        target = wp.vec3(aim[0], aim[1], aim[2]) / touch[3]
        spared = 1.0 - wp.min(1.0, touch[3] / mass)
        share = 1.0 - spared * spared * spared * spared
        relative = v - target
        approach = wp.dot(relative, n)
        # Of equal arguments, Warp gives the derivative to the second: without adhesion, what comes nearer has none.
        pull = wp.min(adhesion * k.cell * k.cell * k.dt / mass, wp.max(0.0, approach))
        push = share * wp.max(0.0, -approach)
        slid = coulomb(relative - approach * n, push, aim[3] / touch[3], k.slip_speed)
        result = target + (approach + push - share * pull) * n + slid
    return result


@wp.func
def pinch(k: Constants, v: wp.vec3, mass: float, touch: wp.vec4, aim: wp.vec4) -> wp.vec3:
    """A node's velocity where tools press from opposite sides, so that their normals cancel: it goes with them."""
    result = v
    if touch[3] > LEAST_TOUCH * k.least_mass:
        # Divided before it is squared: the derivative has the denominator's square, which would be 0 in float32.
        agreement = wp.length_sq(wp.vec3(touch[0], touch[1], touch[2]) / touch[3])
        spared = 1.0 - wp.min(1.0, touch[3] / mass)
        hold = wp.max(0.0, 1.0 - 4.0 * agreement) * (1.0 - spared * spared * spared * spared)
        result = v + hold * (wp.vec3(aim[0], aim[1], aim[2]) / touch[3] - v)
    return result
