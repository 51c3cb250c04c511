"""Appearance of a cell to its cameras: the object, the arm's links, the tool, and the fixtures on the table."""

from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.geometry.scene_description import Stage
from app.core.geometry.shapes.base import Colour, Vector
from app.core.geometry.shapes.fixtures import Bowl, Fixture, Mat, Obstacle, Rack
from app.core.geometry.shapes.tools import HAND_DISTANCE_M, HANDLE_RADIUS_M, Finger, Gripper, HeldBowl, Paddle, Tool
from app.core.types import ToolPose
from app.rig.simulated.kinds import kind_of
from app.rig.simulated.worlds.arm_model import FOREARM_M, HAND_M, SHOULDER_M, UPPER_ARM_M, link_frames
from app.rig.simulated.worlds.shapes import Surface, body_of_revolution, bowl, box, hull
from app.rig.simulated.worlds.world import Snapshot

Frame: TypeAlias = Float64[np.ndarray, "4 4"]

_MAT_M = 0.0005
"""Drawn thickness of a mark on the table: less than the cameras' noise."""
_WHITE: Colour = (0.82, 0.83, 0.85)
_DARK: Colour = (0.13, 0.13, 0.15)


@final
@dataclass(frozen=True, kw_only=True)
class TaperedRod:
    """A straight tapered rod on the z axis of a link, `low` to `high` [m], as drawn."""

    link: int
    low: float
    high: float
    radius: float
    colour: Colour


RODS = (
    TaperedRod(link=0, low=-SHOULDER_M, high=-SHOULDER_M + 0.12, radius=0.075, colour=_DARK),
    TaperedRod(link=0, low=-SHOULDER_M + 0.12, high=0.05, radius=0.06, colour=_WHITE),
    TaperedRod(link=1, low=0.0, high=UPPER_ARM_M / 2, radius=0.055, colour=_WHITE),
    TaperedRod(link=2, low=0.0, high=UPPER_ARM_M / 2 + 0.05, radius=0.05, colour=_WHITE),
    TaperedRod(link=3, low=0.0, high=FOREARM_M / 2, radius=0.045, colour=_WHITE),
    TaperedRod(link=4, low=0.0, high=FOREARM_M / 2 + 0.04, radius=0.042, colour=_WHITE),
    TaperedRod(link=6, low=-HAND_M / 2, high=-0.03, radius=0.04, colour=_WHITE),
    TaperedRod(link=6, low=-0.03, high=HAND_M / 2 - HAND_DISTANCE_M, radius=0.032, colour=_DARK),
)


def surfaces(snapshot: Snapshot, stage: Stage) -> list[Surface]:
    """Surfaces in the cell at `snapshot`, the object first."""
    frames = link_frames(snapshot.joints)
    parts = kind_of(stage).surfaces(stage, snapshot.nodes)
    parts += [_rod_surface(rod, frames[rod.link]) for rod in RODS]
    parts += _tool(stage.tool, snapshot.tool, frames[7])
    for fixture in stage.fixtures:
        parts += _fixture(fixture)
    return parts


def _rod_surface(rod: TaperedRod, frame: Frame) -> Surface:
    heights = np.array([rod.low, rod.low + 0.3 * rod.radius, rod.high - 0.3 * rod.radius, rod.high])
    radii = rod.radius * np.array([0.7, 1.0, 1.0, 0.7])
    return body_of_revolution(heights, radii, frame, rod.colour)


def _tool(tool: Tool, pose: ToolPose, tip: Frame) -> list[Surface]:
    """The tool at its pose; `tip` is the frame of the arm's last link there."""
    match tool:
        case Finger():
            return [_finger(tool, tip) if tool.half_width_m == 0 else _flat_finger(tool, tip)]
        case Paddle():
            return _paddle(tool, pose, tip)
        case HeldBowl():
            frame = np.eye(4)
            # Upright where the tool points down, which is half a turn about x.
            turn = Rotation.from_quat(pose[3:7], scalar_first=True).as_matrix()
            frame[:3, :3], frame[:3, 3] = turn @ np.diag([1.0, -1.0, -1.0]), pose[:3]
            return [bowl(tool.radius_m, tool.thickness_m, frame, tool.colour)]
        case Gripper():
            return [_jaw(tool, pose, side) for side in (-1, 1)]


def _fixture(fixture: Fixture) -> list[Surface]:
    """Surfaces of a fixture on the table."""
    match fixture:
        case Obstacle():
            frame = np.eye(4)
            frame[:3, 3] = fixture.place_m
            return [box(fixture.half_m, frame, fixture.colour)]
        case Mat():
            frame = np.eye(4)
            frame[:2, 3] = fixture.place_m
            return [body_of_revolution(np.array([0.0, _MAT_M]), np.full(2, fixture.radius_m), frame, fixture.colour)]
        case Bowl():
            frame = np.eye(4)
            frame[:3, 3] = fixture.place_m
            return [bowl(fixture.radius_m, fixture.thickness_m, frame, fixture.colour)]
        case Rack():
            return [_rack_rod(fixture, begin, end) for begin, end in fixture.ends_m()]


def _paddle(paddle: Paddle, pose: ToolPose, tip: Frame) -> list[Surface]:
    """The board about the tool's position, and its handle up to the hand (the tip's z axis points down)."""
    frame = np.eye(4)
    frame[:3, :3] = Rotation.from_quat(pose[3:7], scalar_first=True).as_matrix()
    frame[:3, 3] = pose[:3]
    heights = np.array([-HAND_DISTANCE_M, -paddle.half_m[2]])
    return [box(paddle.half_m, frame, _DARK), body_of_revolution(heights, np.full(2, HANDLE_RADIUS_M), tip, _DARK)]


def _finger(finger: Finger, tip: Frame) -> Surface:
    """The finger as simulated: a capsule whose lowest point is the tip (the tip's z axis points down)."""
    angle = np.radians([0.0, 25.0, 50.0, 75.0, 88.0])
    heights = finger.radius_m * (np.sin(angle) - 1.0)
    heights, radii = np.concatenate([[-HAND_DISTANCE_M], heights]), finger.radius_m * np.cos(angle)
    return body_of_revolution(heights, np.concatenate([[finger.radius_m], radii]), tip, _DARK)


def _flat_finger(finger: Finger, tip: Frame) -> Surface:
    """The plate with round edges as simulated: the hull of a ball at both ends of its core, below and above."""
    middles = tip[:3, 3] - finger.radius_m * tip[:3, 2] + np.asarray(finger.ends_m())
    top = middles - (HAND_DISTANCE_M - finger.radius_m) * tip[:3, 2]
    return hull(np.concatenate([middles, top]), finger.radius_m, _DARK)


def _jaw(gripper: Gripper, pose: ToolPose, side: int) -> Surface:
    """A finger of the gripper, beside the tool's z axis, which points down."""
    _, thick, tall = gripper.half_m
    frame = np.eye(4)
    frame[:3, :3] = Rotation.from_quat(pose[3:7], scalar_first=True).as_matrix()
    frame[:3, 3] = pose[:3] + frame[:3, :3] @ [0.0, side * (pose[7] / 2 + thick), -tall]
    return box(gripper.half_m, frame, _DARK)


def _rack_rod(rack: Rack, begin: Vector, end: Vector) -> Surface:
    """A rod of the rack, a cylinder about its axis, which is the world's x."""
    frame = np.eye(4)
    # Its z axis is the world's x, and so on.
    frame[:3, :3] = np.roll(np.eye(3), 1, axis=0)
    frame[:3, 3] = begin
    heights = np.array([0.0, end[0] - begin[0]])
    return body_of_revolution(heights, np.full(2, rack.radius_m), frame, rack.colour)
