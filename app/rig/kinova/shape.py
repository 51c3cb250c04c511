"""Geometry of a Gen3 with vision module and Robotiq 2F-85: capsules about its links, posed by measured joints.

Source: Kinovarobotics/ros_kortex, kortex_description, `arms/gen3/7dof` (joints, and the published surfaces of links)
and `grippers/robotiq_2f_85`. The capsules were fitted to these surfaces: of some 30,000 points on each link 99.9 % are
less than 3 mm outside of all capsules, and the farthest is 5.3 mm; the mask of perception adds 10 mm.
"""

import numpy as np
from jaxtyping import Float64

from app.core.geometry.arm_geometry import ArmShape, Joint, LinkCapsule
from app.core.geometry.shapes.base import Vector
from app.core.geometry.shapes.tools import Tool
from app.rig.kinova.gen3 import FIXED, FLANGE_M, Joints, frames

_Z: Vector = (0.0, 0.0, 1.0)
_LINKS: tuple[tuple[int, Vector, Vector, float], ...] = (
    (0, (0.0, 0.0, 0.015), (0.0, 0.0, 0.140), 0.051),
    (1, (0.0, 0.0, -0.035), (0.0, -0.010, -0.125), 0.052),
    (2, (0.0, 0.0, -0.020), (0.0, -0.150, -0.015), 0.046),
    (2, (0.0, -0.180, -0.005), (0.0, -0.205, -0.005), 0.048),
    (3, (0.0, 0.0, -0.020), (0.0, -0.010, -0.215), 0.050),
    (4, (0.0, 0.005, -0.020), (0.0, -0.010, -0.025), 0.047),
    (4, (0.0, -0.025, -0.030), (0.0, -0.200, -0.005), 0.040),
    (5, (0.0, 0.0, -0.020), (0.0, -0.005, -0.060), 0.036),
    (5, (0.0, -0.005, -0.060), (0.0, -0.015, -0.105), 0.040),
    (6, (0.0, 0.0, -0.020), (0.0, -0.035, -0.025), 0.036),
    (6, (0.0, -0.070, -0.005), (0.0, -0.100, 0.0), 0.039),
    (7, (0.0, 0.0, -0.020), (0.0, 0.0, -0.050), 0.039),
    (7, (-0.030, -0.050, -0.053), (0.030, -0.050, -0.053), 0.026),
)
"""Link, begin and end in its frame, radius [m]. The last is the vision module."""
_GRIPPER: tuple[tuple[Vector, Vector, float], ...] = (
    ((0.0, 0.0, 0.025), (0.0, 0.0, 0.070), 0.042),
    ((-0.040, 0.0, 0.075), (0.040, 0.0, 0.075), 0.035),
    ((-0.048, 0.0, 0.105), (0.048, 0.0, 0.105), 0.026),
)
"""Capsules in the flange's frame, along whose x axis the fingers open: the body, and the sweep of the knuckles."""
_CLOSED: tuple[Vector, Vector, float] = ((0.0, 0.0, 0.110), (0.0, 0.0, 0.140), 0.028)
"""Capsule of fingers that hold a tool; their tips are 0.163 m from the flange. Fingers that are the tool themselves
move with its opening, and belong to the tool's own shape."""
_SHANK_M, _HELD_M = 0.012, 0.09
"""Radius of the shank between the gripper's fingers and a tool, and length of the tool's own part from its tip."""


def known_gen3(tool: Tool, tip_m: float) -> ArmShape:
    """The arm whose gripper is this tool, or holds it with its tip `tip_m` from the flange, along its axis."""
    joints = tuple(Joint(T_link_joint=fixed, axis=_Z) for fixed in FIXED)
    limbs = [LinkCapsule(link=link, begin=begin, end=end, radius_m=radius) for link, begin, end, radius in _LINKS]
    limbs += [_on_flange(*each) for each in _gripper(tool, tip_m)]
    return ArmShape(joints=joints, limbs=tuple(limbs), tool=tool)


def tip_m(joints: Joints, tip: Float64[np.ndarray, "3"]) -> float:
    """Distance of the tool's tip, at `tip` [m, world], from the flange along its axis [m], for these joints."""
    link = frames(joints)[6]
    return float(-(link[:3, :3].T @ (tip - link[:3, 3]))[2] - FLANGE_M)


def _gripper(tool: Tool, tip_m: float) -> list[tuple[Vector, Vector, float]]:
    """Capsules at the flange, without the tool's own pieces."""
    if not tool.has_shank:
        return [*_GRIPPER]
    if tip_m - _HELD_M > _CLOSED[1][2]:
        return [*_GRIPPER, _CLOSED, (_CLOSED[1], (0.0, 0.0, tip_m - _HELD_M), _SHANK_M)]
    return [*_GRIPPER, _CLOSED]


def _on_flange(begin: Vector, end: Vector, radius_m: float) -> LinkCapsule:
    """A capsule in the flange's frame: that of the last link, turned by half about x, at its end."""
    (x0, y0, z0), (x1, y1, z1) = begin, end
    return LinkCapsule(link=7, begin=(x0, -y0, -FLANGE_M - z0), end=(x1, -y1, -FLANGE_M - z1), radius_m=radius_m)
