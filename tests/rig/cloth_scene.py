"""A cloth, a gripper and a rack to test the simulated cell with."""

import numpy as np

from app.core.geometry.scene_description import Cloth, Stage
from app.core.geometry.shapes.fixtures import Rack
from app.core.geometry.shapes.tools import Gripper
from app.core.motion import pointing_down
from app.core.types import ToolPose
from app.rig.simulated.worlds.cloth_world import ClothWorld

CLOTH = Cloth(size_m=0.25, mass_kg=0.0125, colour=(0.15, 0.35, 0.80))
GRIPPER = Gripper(half_m=(0.030, 0.006, 0.025), opening_m=0.040, closed_m=0.012)
RACK = Rack(count=2, spacing_m=0.06, half_length_m=0.20, radius_m=0.010, place_m=(0.55, 0.10, 0.18), friction=0.5)
STAGE = Stage(body=CLOTH, tool=GRIPPER, fixtures=(RACK,))
KNOTS = CLOTH.nodes_a_side
MESH_M = CLOTH.size_m / (KNOTS - 1)


def flat(x_m: float, y_m: float, z_m: float = 0.002, *, turn_rad: float = 0.0) -> np.ndarray:
    """Knots of a flat cloth about this middle."""
    axis = np.linspace(-CLOTH.size_m / 2, CLOTH.size_m / 2, KNOTS)
    u, v = (each.ravel() for each in np.meshgrid(axis, axis, indexing="ij"))
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    return np.stack([x_m + c * u - s * v, y_m + s * u + c * v, np.full_like(u, z_m)], axis=1)


def hand(x_m: float, y_m: float, z_m: float, opening_m: float) -> ToolPose:
    """The gripper there."""
    pose = pointing_down(np.array([x_m, y_m, z_m]))
    pose[7] = opening_m
    return pose


def go(world: ClothWorld, *way: ToolPose, speed_m_s: float = 0.2, rest_s: float = 0.0) -> np.ndarray:
    """Along the way at this speed, opening at half of it, then rest: the knots."""
    for pose in way:
        far = max(np.linalg.norm(pose[:3] - world.tool[:3]), 2 * abs(pose[7] - world.tool[7]))
        world.step(pose, max(far / speed_m_s, 0.01))
    if rest_s:
        world.step(world.tool, rest_s)
    return world.nodes()


def grasped(world: ClothWorld, x_m: float, y_m: float) -> np.ndarray:
    """Pick the cloth up there, with fingers that come down open, and lift it out of reach of the table."""
    world.place(hand(x_m, y_m, 0.10, 0.04))
    return go(world, hand(x_m, y_m, 0.004, 0.04), hand(x_m, y_m, 0.004, 0.004), hand(x_m, y_m, 0.35, 0.004), rest_s=1.0)
