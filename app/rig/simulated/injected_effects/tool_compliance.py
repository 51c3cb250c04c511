"""Tool compliance: the tool sits on level springs of c metres a newton, which no encoder measures.

Two more slides of the tool's own body, beyond those that move it; light, and damped so that it does not swing. The
springs of a tool that turns, a paddle, turn with it.
"""

from math import sqrt
from typing import Any

from app.rig.simulated.injected_effects.base import ON_TABLES, Hidden, InjectedParameter, Values, plain
from app.rig.simulated.worlds.engine import TOOL, mujoco
from app.rig.simulated.worlds.physics import WorldPhysics

_TIP_KG = 0.005
_COPIED = ("type", "size", "contype", "conaffinity", "condim", "friction", "solref", "priority")


def _build(spec: Any, _physics: WorldPhysics, values: Values) -> None:
    if values[0] == 0:
        return
    tool, stiffness = spec.body(TOOL), 1.0 / float(values[0])
    if any(joint.type == mujoco.mjtJoint.mjJNT_BALL for joint in tool.joints):
        tool = _apart(spec, tool)
    tool.geoms[0].mass = _TIP_KG
    for axis in ([1, 0, 0], [0, 1, 0]):
        tool.add_joint(
            type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, stiffness=stiffness, damping=2 * sqrt(stiffness * _TIP_KG)
        )


def _apart(spec: Any, tool: Any) -> Any:
    """A body of its own for the shape of a tool that turns, on the one that is moved: that has all the joints it may.

    The moved body's own inertia is nothing beside that of its joints.
    """
    tool.name, tool.explicitinertial = f"{TOOL}'s arm", True
    tool.mass, tool.inertia = _TIP_KG, [_TIP_KG] * 3
    carried, (shape,) = tool.add_body(name=TOOL, gravcomp=1.0), tool.geoms
    carried.add_geom(mass=_TIP_KG, **{name: getattr(shape, name) for name in _COPIED})
    spec.delete(shape)
    return carried


HIDDEN = Hidden(
    family="actuation",
    bodies=ON_TABLES,
    quantities=(InjectedParameter(name="tool_compliance", unit="m/N", typical=0.02, high=0.2),),
    draw=plain,
    build=_build,
)
