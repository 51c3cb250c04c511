"""Tool compliance: the finger's tip sits on level springs of c metres a newton, which no encoder measures.

Two more slides of the finger's own body, beyond those that move it; light, and damped so that it does not swing.
"""

from math import sqrt
from typing import Any

from app.rig.simulated.injected_effects.base import Hidden, InjectedParameter, Values, plain
from app.rig.simulated.worlds.engine import mujoco
from app.rig.simulated.worlds.physics import WorldPhysics

_TIP_KG = 0.005


def _build(spec: Any, _physics: WorldPhysics, values: Values) -> None:
    if values[0] == 0:
        return
    finger, stiffness = spec.body("finger"), 1.0 / float(values[0])
    finger.geoms[0].mass = _TIP_KG
    for axis in ([1, 0, 0], [0, 1, 0]):
        finger.add_joint(
            type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, stiffness=stiffness, damping=2 * sqrt(stiffness * _TIP_KG)
        )


HIDDEN = Hidden(
    family="actuation",
    quantities=(InjectedParameter(name="tool_compliance", unit="m/N", typical=0.02, high=0.2),),
    draw=plain,
    build=_build,
)
