"""Rest curvature: the springs of the rope's hinges rest at a bend, k to the left of the way along it."""

from typing import Any

from app.rig.simulated.hidden.base import Hidden, Quantity, Values, signed
from app.rig.simulated.physics import WorldPhysics


def _build(spec: Any, physics: WorldPhysics, values: Values) -> None:
    for index in range(1, physics.rope.segments):
        body = spec.body(f"rope{index}")
        # The first of its two hinges turns about the vertical; a body stands a segment's length from its parent.
        body.joints[0].springref = values[0] * body.pos[0]


HIDDEN = Hidden(
    family="physics",
    quantities=(Quantity(name="rest_curvature", unit="1/m", typical=4.0, high=15.0),),
    draw=signed,
    build=_build,
)
