"""Anisotropic friction: mu (1 + a cos 2 phi + b sin 2 phi) in the direction phi of sliding.

The lowest term that is the same forth and back (Zmitrowicz 2006, "Models of kinematics dependent anisotropic and
heterogeneous friction"): wood grain, brushed metal, woven cloth. Real pushes show it (Ma and Rodriguez 2018).
"""

# As static types, Warp's vectors have no operators.
# pyright: reportOperatorIssue=false

from typing import Any

import warp as wp

from app.sim.effects.base import ON_TABLES, Effect, NodeContext, linear
from app.sim.rods.effect import RodEffect

REST = wp.constant(1.0e-6)
"""Square of the speed [m^2/s^2] below which there is no direction of sliding: 1 mm/s."""


@wp.func
def directed_friction(mu: float, node: NodeContext, phi: Any, at: int) -> float:
    """The coefficient in the direction in which the node slides; double angles without an arc tangent."""
    x, y = node.v[0], node.v[1]
    return mu * (1.0 + (phi[at] * (x * x - y * y) + phi[at + 1] * (2.0 * x * y)) / (x * x + y * y + REST))


_ENDS = (-0.6, 0.2, 0.6)
_AXES = "How much more the table rubs along x, and less along y, as a share of its friction."
_DIAGONALS = "How much more the table rubs along the diagonal x = y, and less along x = -y."
EFFECT = Effect(
    objects=ON_TABLES,
    parameters=(
        linear("anisotropy_axes", "1", _ENDS, _AXES, null_prior=(0.0, 0.14), rod_null_prior=(0.0, 0.081)),
        linear("anisotropy_diagonals", "1", _ENDS, _DIAGONALS, null_prior=(0.0, 0.14), rod_null_prior=(0.0, 0.081)),
    ),
    table_friction=directed_friction,
    rod=RodEffect(
        friction=f"""
        const T square = vx * vx + vy * vy + {REST}f;
        mu *= 1.0f + (phi[0] * (vx * vx - vy * vy) + phi[1] * (2.0f * vx * vy)) / square;
        """
    ),
)
