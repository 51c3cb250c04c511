"""Rest curvature: the springs of the rope's hinges rest at a bend, k to the left along the rope."""

from typing import Any

from app.rig.simulated.injected_effects.base import ROPES, Hidden, InjectedParameter, Values, with_random_sign
from app.rig.simulated.worlds.physics import WorldPhysics
from app.rig.simulated.worlds.rope import hinge_owner


def _build(spec: Any, physics: WorldPhysics, values: Values) -> None:
    for index in range(1, physics.rope.segments):
        length_m = 2 * abs(spec.body(f"rope{index}").ipos[0])
        # The first of its two hinges turns about the vertical.
        spec.body(f"rope{hinge_owner(index, physics.rope.segments)}").joints[0].springref = values[0] * length_m


HIDDEN = Hidden(
    family="physics",
    bodies=ROPES,
    quantities=(InjectedParameter(name="rest_curvature", unit="1/m", typical=4.0, high=15.0),),
    draw=with_random_sign,
    build=_build,
)
