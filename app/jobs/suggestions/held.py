"""A suggested carry or pour, which goes on from where the tool is that holds the object."""

from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation

from app.core.motion import Motion
from app.core.types import Points, ToolPose
from app.planner.actions.carry_actions import Carries
from app.planner.actions.pour_actions import Pours

if TYPE_CHECKING:
    from app.discovery.dataset.bowls import PouredBowls

Held: TypeAlias = Carries | Pours

_APPROACH_M_S = 0.10
_THERE_M = 1e-3
"""A tool this near to where a motion begins is there."""
_HELD_M = 0.04
"""A held object has points this near to the fingertips: cameras do not see the 2 cm that are between the fingers."""
_LEAN_RAD = 0.1
"""A tool stands upright within this angle, by which a bowl that is filled to half its radius spills nothing."""


def waits_for(tool: ToolPose, x: Points, actions: Held) -> str:
    """The condition on which a motion of the object `x` (N, 3) [m] can go on from here; empty where it holds."""
    if isinstance(actions, Carries):
        is_open = tool[7] > sum(actions.openings_m) / 2
        holds = not is_open and float(np.linalg.norm(x - tool[:3], axis=1).min()) < _HELD_M
        return "" if holds else "the gripper holds the cloth"
    axis = _turn(tool).apply([0.0, 0.0, 1.0])
    return "the held bowl is upright" if np.arccos(np.clip(-axis[2], -1.0, 1.0)) > _LEAN_RAD else ""


def begin_at(asked: Motion, tool: ToolPose, actions: Held, bowls: "PouredBowls | None") -> Motion | str:
    """The motion, turned about the vertical and moved so that it begins where the tool is.

    A carry is turned as the gripper is. A pour is turned about the bowl that stands, beside which the held one is; from
    elsewhere beside it the tool goes to where the pour begins first. Where it would leave the places that the task's
    actions may end at, the place nearer to which the tool has to be is returned, as of `waits_for`.
    """
    first = asked.poses[0]
    if bowls is None:
        origin, pivot = first[:3], tool[:3]
        angle = float(_heading(_turn(tool) * _turn(first).inv()))
    else:
        origin = pivot = np.array(bowls.place_m)
        angle = _azimuth(tool, pivot) - _azimuth(first, pivot)
    turned = Rotation.from_rotvec([0.0, 0.0, angle])
    positions = pivot + turned.apply(asked.positions - origin)
    to_held = (turned * _turn(first)).inv() * _turn(tool)
    turns = (turned * Rotation.from_quat(asked.poses[:, 3:7], scalar_first=True) * to_held).as_quat(scalar_first=True)
    openings = np.maximum(asked.poses[:, 7] - first[7] + tool[7], 0.0)
    speeds = asked.speeds
    if np.linalg.norm(positions[0] - tool[:3]) > _THERE_M:
        positions = np.concatenate([tool[None, :3], positions])
        turns, openings = np.concatenate([turns[:1], turns]), np.concatenate([openings[:1], openings])
        speeds = np.concatenate([speeds[:1], [min(_APPROACH_M_S, float(speeds.max()))], speeds[1:]])
    positions[0] = tool[:3]
    if not actions.contains(positions[1:]):
        return f"the tool is nearer to ({_metres(first)}) m, as it would leave where the tool may go from here"
    return Motion(positions=positions, speeds=speeds, turns=turns, openings=openings, continues=True)


def _turn(pose: ToolPose) -> Rotation:
    return Rotation.from_quat(pose[3:7], scalar_first=True)


def _heading(by: Rotation) -> float:
    """Angle [rad] of a rotation's part about the vertical."""
    w, _, _, z = by.as_quat(scalar_first=True)
    return 2 * float(np.arctan2(z, w))


def _azimuth(pose: ToolPose, centre: np.ndarray) -> float:
    """Direction [rad] from the centre to the tool, from x."""
    x, y = pose[:2] - centre[:2]
    return float(np.arctan2(y, x))


def _metres(pose: ToolPose) -> str:
    return ", ".join(f"{each:.2f}" for each in pose[:3])
