"""Arm geometry as plain data: the chain of its joints, and collision capsules about its links.

Perception masks the pixels that it covers; the builder of a rig knows its arm's sizes and states them here.
"""

from dataclasses import dataclass, field
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.geometry.shapes.base import Vector
from app.core.geometry.shapes.tools import Tool
from app.core.types import ToolPose, Transform

JointAngles: TypeAlias = Float64[np.ndarray, " J"]
"""Joint angles [rad], from base to wrist."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Joint:
    """A hinge: where it is in the frame of the link before it, and the axis of its own frame that it turns about."""

    T_link_joint: Transform
    axis: Vector


@final
@dataclass(frozen=True, kw_only=True)
class LinkCapsule:
    """A capsule [m] in the frame of link `link`: link 0 is fixed, and joint k moves link k."""

    link: int
    begin: Vector
    end: Vector
    radius_m: float


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ArmShape:
    """The joints in order, the capsules, the tool (held, or the hand itself), and the pose of the arm's base."""

    joints: tuple[Joint, ...]
    limbs: tuple[LinkCapsule, ...]
    tool: Tool
    T_world_base: Transform = field(default_factory=lambda: np.eye(4))

    def links(self, angles: JointAngles) -> Float64[np.ndarray, "L 4 4"]:
        """`T_world_link` of each link, the fixed one first."""
        frames = [self.T_world_base]
        for joint, angle in zip(self.joints, angles, strict=True):
            turn = np.eye(4)
            turn[:3, :3] = Rotation.from_rotvec(angle * np.asarray(joint.axis)).as_matrix()
            frames.append(frames[-1] @ joint.T_link_joint @ turn)
        return np.stack(frames)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class JointState:
    """Configuration of an arm: its joint angles, and the pose and opening of its tool."""

    joints: JointAngles
    tool: ToolPose
