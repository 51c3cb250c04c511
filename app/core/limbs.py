"""What an arm looks like, as plain data: its joints one after another, and a capsule about each part of its links.

Perception leaves out the pixels that it covers; whoever builds a rig knows its arm's sizes and says them here.
"""

from dataclasses import dataclass, field
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.stage import Tool, Vector
from app.core.types import ToolPose, Transform

JointAngles: TypeAlias = Float64[np.ndarray, " J"]
"""Of the joints [rad], from base to wrist."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Joint:
    """A hinge: where it is in the frame of the link before it, and the axis of its own frame that it turns about."""

    T_link_joint: Transform
    axis: Vector


@final
@dataclass(frozen=True, kw_only=True)
class Limb:
    """A capsule [m] in the frame of the link `link`: 0 stands still, and joint k moves link k."""

    link: int
    begin: Vector
    end: Vector
    radius_m: float


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ArmShape:
    """The joints in order, the limbs, what the hand holds or is, and where the arm's base stands."""

    joints: tuple[Joint, ...]
    limbs: tuple[Limb, ...]
    tool: Tool
    T_world_base: Transform = field(default_factory=lambda: np.eye(4))

    def links(self, angles: JointAngles) -> Float64[np.ndarray, "L 4 4"]:
        """`T_world_link` of each link, the one that stands still first."""
        frames = [self.T_world_base]
        for joint, angle in zip(self.joints, angles, strict=True):
            turn = np.eye(4)
            turn[:3, :3] = Rotation.from_rotvec(angle * np.asarray(joint.axis)).as_matrix()
            frames.append(frames[-1] @ joint.T_link_joint @ turn)
        return np.stack(frames)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Posture:
    """Where an arm is: its joints' angles, and the pose and opening of its tool."""

    joints: JointAngles
    tool: ToolPose
