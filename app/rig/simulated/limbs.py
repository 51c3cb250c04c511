"""Geometry of the drawn arm for perception: a capsule about each of its rods."""

import numpy as np

from app.core.geometry.arm_geometry import ArmShape, Joint, LinkCapsule
from app.core.geometry.shapes.tools import Tool
from app.rig.simulated.cameras.appearance import RODS
from app.rig.simulated.worlds.arm_model import OFFSETS_M


def known_arm(tool: Tool) -> ArmShape:
    """The simulated arm with this tool."""
    return ArmShape(joints=tuple(map(_joint, range(len(OFFSETS_M)))), limbs=_LIMBS, tool=tool)


def _joint(index: int) -> Joint:
    """Joint as in `arm_model.link_frames`: about z, y, z, y, ..."""
    place = np.eye(4)
    place[2, 3] = OFFSETS_M[index]
    return Joint(T_link_joint=place, axis=(0.0, 1.0, 0.0) if index % 2 else (0.0, 0.0, 1.0))


def _limb(link: int, low: float, high: float, radius_m: float) -> LinkCapsule:
    """Capsule of a rod with flat ends: its round ends begin a radius inside, where the rod is long enough."""
    inset = min(0.5 * radius_m, (high - low) / 2)
    return LinkCapsule(link=link + 1, begin=(0.0, 0.0, low + inset), end=(0.0, 0.0, high - inset), radius_m=radius_m)


_LIMBS = tuple(_limb(rod.link, rod.low, rod.high, rod.radius) for rod in RODS)
