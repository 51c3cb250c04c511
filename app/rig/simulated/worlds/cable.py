"""The rope as MuJoCo's elastic rod: mass points joined by segments of fixed length, a one-dimensional flex.

It bends by the forces of a discrete elastic rod (Bergou et al. 2008, "Discrete elastic rods") about a straight line,
without twist: points do not roll. Its segments are capsules to finger and walls, its points touch the table.
"""

from math import pi
from typing import Any, final

import numpy as np
from jaxtyping import Float64, Int

from app.core.geometry.scene_description import Rope
from app.rig.simulated.worlds.engine import mujoco
from app.rig.simulated.worlds.physics import CablePhysics, Centreline, WorldPhysics
from app.rig.simulated.worlds.rope import FINGER_BIT, TABLE_BIT

_OWN_BIT = 4
_NEIGHBOURS_APART = 1
"""Points that are no farther from each other along the rope overlap, so they do not collide."""
_POISSON = 0.3
"""Poisson's ratio, without effect: nothing twists."""
_FIRM = (0.98, 0.999, 0.001, 0.5, 2.0)
"""MuJoCo's `solimp` of the segments' lengths: nearly rigid."""

_ITERATIONS = 500
"""Most iterations of MuJoCo's solvers: for bending its usual 100 run out at times, with errors of 1e-6 and a
warning."""


@final
class Cable:
    """Rope of points at `nodes` (S + 1, 3) [m], along any curve; its unstrained shape is straight.

    Raises ValueError for a rigid rope, and for physics without a cable's.
    """

    def __init__(self, rope: Rope, physics: WorldPhysics, nodes: Centreline) -> None:
        if physics.cable is None or rope.rigid:
            raise ValueError("A cable has cable physics, and bends; a rigid rope is a chain.")
        self._rope, self._physics, self._cable, self._nodes = rope, physics, physics.cable, nodes
        lengths = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
        self._straight = np.zeros_like(nodes)
        self._straight[1:, 0] = np.cumsum(lengths)
        self._straight[:, 2] = nodes[:, 2]

    def add(self, spec: Any) -> None:
        """Add points and flex to the MuJoCo `spec`, straight."""
        spec.option.iterations = _ITERATIONS
        count = len(self._nodes)
        names = [f"rope{index}" for index in range(count)]
        for name, place, mass_kg in zip(names, self._straight, _masses(self._rope, count), strict=True):
            _add_point(spec, name, place, mass_kg, self._rope.radius_m, self._physics)
        for index in range(count):
            for near in range(max(0, index - _NEIGHBOURS_APART), index):
                spec.add_exclude(bodyname1=names[near], bodyname2=names[index])
        _add_flex(spec, names, self._rope.radius_m, self._cable, self._physics.contact_time_s)

    def lay(self, model: Any, data: Any) -> None:
        """Bind to the compiled model and its state, and put every point at its initial position."""
        self._data = data
        self._links = np.array([model.body(f"rope{index}").id for index in range(len(self._nodes))])
        slides = model.jnt_qposadr[model.body_jntadr[self._links]]
        data.qpos[slides[:, None] + np.arange(3)] = self._nodes - self._straight

    @property
    def links(self) -> Int[np.ndarray, " N"]:
        """The points' bodies."""
        return self._links

    def nodes(self) -> Centreline:
        """The points [m], shape (S + 1, 3)."""
        return self._data.xpos[self._links].copy()


def _masses(rope: Rope, count: int) -> Float64[np.ndarray, " N"]:
    """Masses of the points [kg]: those at the ends have half of the others'."""
    masses = np.full(count, rope.mass_kg / (count - 1))
    masses[[0, -1]] /= 2
    return masses


def _add_point(
    spec: Any, name: str, place: Float64[np.ndarray, "3"], mass_kg: float, radius_m: float, physics: WorldPhysics
) -> None:
    """Add a body that slides and does not rotate, with a sphere that meets other parts of the rope."""
    body = spec.worldbody.add_body(name=name, pos=place)
    for axis in np.eye(3):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    body.explicitinertial, body.mass = True, mass_kg
    body.inertia = [2 / 5 * mass_kg * radius_m**2] * 3
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[radius_m, 0, 0],
        mass=0.0,
        contype=_OWN_BIT,
        conaffinity=_OWN_BIT,
        friction=[physics.finger_friction, 0.0, 0.0],
        solref=[physics.contact_time_s, 1.0],
    )


def _add_flex(spec: Any, names: list[str], radius_m: float, cable: CablePhysics, contact_time_s: float) -> None:
    """Add segments between the points: they bend, collide, and keep their length.

    They do not collide with each other: neighbours overlap, which a flex takes for a collision.
    """
    first = np.arange(len(names) - 1)
    flex = spec.add_flex(
        name="rope",
        dim=1,
        radius=radius_m,
        vertbody=names,
        vert=np.zeros(3 * len(names)).tolist(),
        elem=np.stack([first, first + 1], axis=1).ravel().tolist(),
    )
    flex.young, flex.poisson = cable.rigidity_n_m2 / (pi * radius_m**4 / 4), _POISSON
    flex.damping = cable.bend_damping_s
    flex.contype = flex.conaffinity = TABLE_BIT | FINGER_BIT
    flex.condim, flex.selfcollide = 3, mujoco.mjtFlexSelf.mjFLEXSELF_NONE
    flex.solref = [contact_time_s, 1.0]
    spec.add_equality(
        type=mujoco.mjtEq.mjEQ_FLEX,
        objtype=mujoco.mjtObj.mjOBJ_FLEX,
        name1="rope",
        solref=[cable.stretch_time_s, 1.0],
        solimp=_FIRM,
    )
