"""Hidden obstacle: a soft post of 2 cm, invisible to cameras, stops the object, and not the tool, at the rate k.

A geom whose contacts are dampers: MuJoCo's direct form of `solref` is (-stiffness, -damping) of the contact's
acceleration [1/s^2, 1/s].
"""

from typing import Any

from app.rig.simulated.injected_effects.base import (
    SOLIDS,
    Hidden,
    InjectedParameter,
    Values,
    where,
    with_random_place,
)
from app.rig.simulated.worlds.engine import TOOL, mujoco
from app.rig.simulated.worlds.physics import WorldPhysics
from app.rig.simulated.worlds.rope import FINGER_BIT

_RADIUS_M, _HEIGHT_M = 0.02, 0.05
_NO_STIFFNESS = -1e-6
"""Stiffness of the contacts: negative, as the direct form requires, and negligible."""


def _build(spec: Any, _physics: WorldPhysics, values: Values) -> None:
    if values[0] == 0:
        return
    post = spec.worldbody.add_body(name="post", pos=[values[1], values[2], 0.0])
    post.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[_RADIUS_M, 0, 0],
        fromto=[0, 0, 0, 0, 0, _HEIGHT_M],
        contype=FINGER_BIT,
        conaffinity=FINGER_BIT,
        friction=[0.0, 0.0, 0.0],
        solref=[_NO_STIFFNESS, -values[0]],
        priority=2,
    )
    spec.add_exclude(bodyname1="post", bodyname2=TOOL)


HIDDEN = Hidden(
    family="physics",
    bodies=SOLIDS,
    quantities=(InjectedParameter(name="obstacle_rate", unit="1/s", typical=417.0, high=2080.0), *where("obstacle")),
    draw=with_random_place,
    build=_build,
)
