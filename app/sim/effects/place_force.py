"""A force that depends on place alone, to first order: f / (m g) = p + r d + s n x d + (a dx + b dy, b dx - a dy).

d is the way from (0.55, 0) m. Every linear field is a spread r, a swirl s and two stretches a, b (Helmholtz 1858, "On
integrals of the hydrodynamical equations"); with the push p, each of them is about a point of its own. A library for
what no cause of the catalogue explains, and no cause itself: see `discovery/unexplained/formula.py`.
"""

from typing import Any

import warp as wp

from app.sim.effects.base import MIDDLE_M, Effect, NodeContext, linear
from app.sim.parameter import NullPrior, ParameterSpec
from app.sim.rods.effect import RodEffect

MIDDLE_X, MIDDLE_Y = MIDDLE_M
"""The middle of the workspace [m]."""


@wp.func
def placed_velocity(v: wp.vec3, node: NodeContext, phi: Any, at: int) -> wp.vec3:
    """The velocity after one substep of the force."""
    x, y = node.x[0] - wp.static(MIDDLE_X), node.x[1] - wp.static(MIDDLE_Y)
    ahead = phi[at] + (phi[at + 2] + phi[at + 4]) * x + (phi[at + 5] - phi[at + 3]) * y
    aside = phi[at + 1] + (phi[at + 5] + phi[at + 3]) * x + (phi[at + 2] - phi[at + 4]) * y
    return v + node.gravity * node.dt * wp.vec3(ahead, aside, 0.0)


def _share(name: str, unit: str, typical: float, about: str, rod_null_prior: NullPrior) -> ParameterSpec:
    """A coefficient of either sign, up to five times as large as it is typically met."""
    end = 5 * typical
    return linear(name, unit, (-end, typical, end), about, rod_null_prior=rod_null_prior)


_SPREAD = "Push away from a point by each metre from it, as a share of weight."
_SWIRL = "Push round a point, to the left, by each metre from it, as a share of weight."
_STRETCH = "Push outwards along x and inwards along y, a metre, as a share of weight."
EFFECT = Effect(
    parameters=(
        _share("push_x", "1", 0.1, "Push along x, as a share of weight.", (0.0, 0.01)),
        _share("push_y", "1", 0.1, "Push along y, as a share of weight.", (0.0, 0.01)),
        _share("spread", "1/m", 0.8, _SPREAD, (-0.004, 0.01)),
        _share("swirl", "1/m", 0.8, _SWIRL, (0.0, 0.008)),
        _share("stretch_axes", "1/m", 0.8, _STRETCH, (0.0, 0.008)),
        _share("stretch_diagonals", "1/m", 0.8, "The same along the diagonals x = y and x = -y.", (0.0, 0.008)),
    ),
    catalogued=False,
    node_velocity=placed_velocity,
    rod=RodEffect(
        velocity=f"""
        const float pull = k.gravity * k.dt;
        const T dx = x - {MIDDLE_X}f, dy = y - {MIDDLE_Y}f;
        vx += pull * (phi[0] + (phi[2] + phi[4]) * dx + (phi[5] - phi[3]) * dy);
        vy += pull * (phi[1] + (phi[5] + phi[3]) * dx + (phi[2] - phi[4]) * dy);
        """
    ),
)
