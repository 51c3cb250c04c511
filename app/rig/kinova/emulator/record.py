"""Record of the commands to the arm, to be searched for ones it should never have been sent."""

from collections import deque
from dataclasses import asdict, dataclass
from typing import Any, final

import numpy as np

from app.rig.kinova.api.messages import Action, GripperCommand, Pose, TwistCommand, WaypointList
from app.rig.kinova.api.messages import Twist as TwistValues

KEPT = 20_000


@final
@dataclass(frozen=True, kw_only=True)
class Told:
    """A command: arrival [s, monotonic], call, highest speeds, and targets.

    `refused`: sub error of its answer, 0 where it was accepted.
    """

    time_s: float
    call: str
    session: int
    linear_m_s: float = 0.0
    angular_deg_s: float = 0.0
    positions: tuple[tuple[float, float, float], ...] = ()
    value: float = 0.0
    refused: int = 0


@final
class Record:
    """The last commands, the oldest first."""

    def __init__(self) -> None:
        self._told = deque[Told](maxlen=KEPT)

    def note(self, time_s: float, call: str, session: int, message: object, refused: int) -> None:
        """Append a command."""
        self._told.append(Told(time_s=time_s, call=call, session=session, refused=refused, **_content(message)))

    def clear(self) -> None:
        """Clear the record."""
        self._told.clear()

    def plain(self) -> list[dict[str, Any]]:
        """The record as plain values, for JSON."""
        return [asdict(each) for each in self._told]


def _content(message: object) -> dict[str, Any]:
    """Speeds and positions in a command."""
    match message:
        case TwistCommand(twist=twist):
            values = twist or TwistValues()
            linear = np.linalg.norm([values.linear_x, values.linear_y, values.linear_z])
            angular = np.linalg.norm([values.angular_x, values.angular_y, values.angular_z])
            return {"linear_m_s": float(linear), "angular_deg_s": float(angular)}
        case WaypointList():
            return _of_waypoints(message)
        case Action(execute_waypoint_list=WaypointList() as ways):
            return _of_waypoints(ways)
        case Action(send_gripper_command=GripperCommand() as command):
            return _content(command)
        case GripperCommand(gripper=gripper):
            return {"value": gripper.finger[0].value if gripper and gripper.finger else 0.0}
        case _:
            return {}


def _of_waypoints(ways: WaypointList) -> dict[str, Any]:
    cartesian = [each.cartesian_waypoint for each in ways.waypoints if each.cartesian_waypoint]
    poses = [each.pose or Pose() for each in cartesian]
    return {
        "linear_m_s": max((each.maximum_linear_velocity for each in cartesian), default=0.0),
        "angular_deg_s": max((each.maximum_angular_velocity for each in cartesian), default=0.0),
        "positions": tuple((pose.x, pose.y, pose.z) for pose in poses),
    }
