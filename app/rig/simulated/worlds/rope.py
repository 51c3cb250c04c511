"""The rope as MuJoCo bodies: capsules in a chain, bending about the vertical and about the level axis, never twisting.

The chain's root, its middle segment, does not roll, nor do the hinges twist. A free root would let the whole rope roll
over the table like a pencil when it is pushed sideways, which takes the friction away and moves the ends with the
middle; a limp rope lies flat instead and its ends trail. The constraint against rolling acts on the root alone: while
it was at one end, the same push ended 3.5 mm elsewhere with the other end first (mean of 30 pushes); in the middle 0.2
mm.
"""

from typing import Any, Protocol, final

import numpy as np
from jaxtyping import Float64, Int

from app.core.geometry.scene_description import Rope
from app.rig.simulated.worlds.engine import mujoco
from app.rig.simulated.worlds.physics import Centreline, WorldPhysics

TABLE_BIT, FINGER_BIT = 1, 2
_NEIGHBOURS_APART = 4
"""Segments closer than this along the chain overlap by construction, so they do not collide."""


class RopeBody(Protocol):
    """A rope in a MuJoCo model; its bodies are called `rope0`, `rope1`, ..."""

    def add(self, spec: Any) -> None:
        """Add it to the MuJoCo `spec`."""
        ...

    def lay(self, model: Any, data: Any) -> None:
        """Bind to the compiled model and its state, and put the rope at its initial place."""
        ...

    @property
    def links(self) -> Int[np.ndarray, " S"]:
        """Its bodies in order."""
        ...

    def nodes(self) -> Centreline:
        """Its nodes [m], from the first end to the last."""
        ...


@final
class Chain:
    """Capsules in a chain through `nodes` (S + 1, 3) [m]."""

    def __init__(self, rope: Rope, physics: WorldPhysics, nodes: Centreline) -> None:
        self._rope, self._physics, self._nodes = rope, physics, nodes
        self._lengths = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
        self._root = root_of(len(self._lengths))

    def add(self, spec: Any) -> None:
        """See `add_rope`."""
        add_rope(spec, self._rope, self._physics, self._nodes)

    def lay(self, model: Any, data: Any) -> None:
        """Bind to the compiled model; the chain was compiled at its initial place."""
        self._data = data
        self._links = np.array([model.body(f"rope{index}").id for index in range(len(self._lengths))])

    @property
    def links(self) -> Int[np.ndarray, " S"]:
        """The segments' bodies."""
        return self._links

    def nodes(self) -> Centreline:
        """Ends of the segments [m], shape (S + 1, 3)."""
        origins, root = self._data.xpos[self._links], self._root
        along = self._data.xmat[self._links].reshape(-1, 3, 3)[:, :, 0] * self._lengths[:, None]
        before, after = origins[:root] - along[:root], origins[root:]
        return np.vstack([before, after, after[-1] + along[-1]])


def resample(centreline: Centreline, points: int) -> Float64[np.ndarray, "points 3"]:
    """`points` points at equal arc length along `centreline`, from its first to its last."""
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(centreline, axis=0), axis=1))])
    at = np.linspace(0.0, arc[-1], points)
    return np.stack([np.interp(at, arc, centreline[:, axis]) for axis in range(3)], axis=1)


def add_rope(spec: Any, rope: Rope, physics: WorldPhysics, nodes: Centreline) -> None:
    """Add the chain through `nodes` (S + 1, 3) to the MuJoCo `spec`; its bodies are called `rope0`, `rope1`, ...

    The chain starts level: only the heading of each segment is taken from `nodes`. A rod's does not bend. A positive
    hinge angle bends the rope to the left, from the first node to the last.
    """
    steps = np.diff(nodes, axis=0)
    lengths, headings = np.linalg.norm(steps, axis=1), np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    root, mass_kg = root_of(len(lengths)), rope.mass_kg / len(lengths)

    def segment(parent: Any, index: int, place: Any, turn: float) -> Any:
        body = parent.add_body(name=f"rope{index}", pos=place, quat=about_z(turn))
        if index == root:
            _add_freedom(body)
        elif not rope.rigid:
            _add_hinges(body, physics, 1.0 if index > root else -1.0)
        _add_shape(body, rope, physics, float(lengths[index]) * (1 if index >= root else -1), mass_kg=mass_kg)
        return body

    middle = before = after = segment(spec.worldbody, root, nodes[root], headings[root])
    for index in range(root + 1, len(lengths)):
        after = segment(after, index, [lengths[index - 1], 0.0, 0.0], headings[index] - headings[index - 1])
    for index in reversed(range(root)):
        place = 0.0 if before is middle else -lengths[index + 1]
        before = segment(before, index, [place, 0.0, 0.0], headings[index] - headings[index + 1])
    for index in range(len(lengths)):
        for near in range(max(0, index - _NEIGHBOURS_APART), index):
            spec.add_exclude(bodyname1=f"rope{near}", bodyname2=f"rope{index}")


def root_of(segments: int) -> int:
    """Index of the chain's root segment: the middle one.

    Segments from it on have their origins at their first nodes, those before it at their second ones.
    """
    return segments // 2


def hinge_owner(index: int, segments: int) -> int:
    """Index of the segment whose body has the hinges between segments `index` - 1 and `index`."""
    return index if index > root_of(segments) else index - 1


def about_z(angle: float) -> Float64[np.ndarray, "4"]:
    """Quaternion w x y z of a rotation by `angle` [rad] about the vertical."""
    return np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])


def _add_freedom(body: Any) -> None:
    """Add the root's degrees of freedom: slides, yaw and pitch, but no roll."""
    for axis in np.eye(3):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    body.add_joint(axis=[0, 0, 1])
    body.add_joint(axis=[0, 1, 0])


def _add_hinges(body: Any, physics: WorldPhysics, sense: float) -> None:
    """Add two sprung hinges, reversed before the root. A rod has none: its segments are one body."""
    rope = physics.rope
    limits = {"limited": True, "range": [-rope.bend_limit_rad, rope.bend_limit_rad]}
    body.add_joint(
        axis=[0, 0, sense],
        stiffness=rope.bend_stiffness_n_m_rad,
        damping=rope.bend_damping_n_m_s_rad,
        springyield=rope.bend_yield_rad,
        **limits,
    )
    body.add_joint(
        axis=[0, sense, 0],
        stiffness=rope.lift_stiffness_n_m_rad,
        damping=rope.lift_damping_n_m_s_rad,
        **limits,
    )


def _add_shape(body: Any, rope: Rope, physics: WorldPhysics, length_m: float, *, mass_kg: float) -> None:
    """Add a capsule that meets finger and rope, and in it a sphere that meets the table; either side of the origin.

    One sphere is one table contact a segment where a capsule would be two, at half the cost and the same friction.
    """
    contact = {"friction": [physics.table_friction, 0.0, 0.0], "solref": [physics.contact_time_s, 1.0], "mass": 0.0}
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[rope.radius_m, 0, 0],
        fromto=[0, 0, 0, length_m, 0, 0],
        contype=FINGER_BIT,
        conaffinity=FINGER_BIT,
        **contact,
    )
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[rope.radius_m, 0, 0],
        pos=[length_m / 2, 0, 0],
        contype=TABLE_BIT,
        conaffinity=0,
        **contact,
    )
    across = mass_kg * (3 * rope.radius_m**2 + length_m**2) / 12
    body.explicitinertial = True
    body.mass = mass_kg
    body.ipos = [length_m / 2, 0, 0]
    body.inertia = [mass_kg * rope.radius_m**2 / 2, across, across]
