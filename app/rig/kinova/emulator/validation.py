"""Validation of waypoint lists by the emulated arm."""

from collections.abc import Iterator

import numpy as np

from app.rig.kinova import gen3
from app.rig.kinova.api.codes import ReferenceFrame
from app.rig.kinova.api.messages import AngularWaypoint, CartesianWaypoint, Pose, TrajectoryError, WaypointList
from app.rig.kinova.gen3 import Joints

OUTSIDE, COUNT, DURATION, JOINT_SPEED, SIZE, JOINT_RANGE = 1, 2, 3, 5, 9, 11
SPEED, TURNING, KINDS, LAST_BLENDS, RADIUS, FRAME = 22, 23, 25, 27, 28, 29
"""`TrajectoryErrorType` of `Base.proto`."""
MOST_WAYPOINTS = 1000
"""Assumed: the arm's own limit of 100 s of trajectory applies first."""


def errors(ways: WaypointList, joints: Joints) -> tuple[TrajectoryError, ...]:
    """Errors of the list from the arm's present joints; empty for a valid list."""
    cartesian = [each.cartesian_waypoint for each in ways.waypoints if each.cartesian_waypoint is not None]
    angular = [each.angular_waypoint for each in ways.waypoints if each.angular_waypoint is not None]
    if not 0 < len(ways.waypoints) <= MOST_WAYPOINTS:
        return (_error(SIZE, 0, len(ways.waypoints), 1, MOST_WAYPOINTS, "number of waypoints"),)
    if len(cartesian) not in (0, len(ways.waypoints)) or len(cartesian) + len(angular) != len(ways.waypoints):
        return (_error(KINDS, 0, len(cartesian), 0, 0, "waypoints of more than one kind, or of none"),)
    return (*_of_angular(angular),) if angular else (*_of_cartesian(cartesian), *_of_radii(cartesian, joints))


def reachable(ways: WaypointList, joints: Joints) -> tuple[TrajectoryError, ...]:
    """Error for the first waypoint whose pose has no inverse kinematics; takes a while."""
    for index, each in enumerate(ways.waypoints):
        if each.cartesian_waypoint is None:
            continue
        found = gen3.solve_joints(gen3.transform(each.cartesian_waypoint.pose or Pose()), joints)
        if found is None:
            return (_error(OUTSIDE, index, 0.0, 0.0, 0.0, "no joint angles reach the pose"),)
        joints = found
    return ()


def _of_angular(waypoints: list[AngularWaypoint]) -> Iterator[TrajectoryError]:
    for index, each in enumerate(waypoints):
        if len(each.angles) != 7:
            yield _error(COUNT, index, len(each.angles), 7, 7, "number of joints")
            continue
        within = np.angle(np.exp(1j * np.radians(each.angles)))
        for joint in np.flatnonzero(np.abs(within) > gen3.RANGE):
            most = float(np.degrees(gen3.RANGE[joint]))
            yield _error(JOINT_RANGE, index, each.angles[joint], -most, most, "joint angle", joint=int(joint))
        if each.duration < 0:
            yield _error(DURATION, index, each.duration, 0, 100, "duration")


def _of_cartesian(waypoints: list[CartesianWaypoint]) -> Iterator[TrajectoryError]:
    for index, each in enumerate(waypoints):
        linear, angular = each.maximum_linear_velocity, each.maximum_angular_velocity
        if not 0 <= linear <= gen3.LINEAR_M_S:
            yield _error(SPEED, index, linear, 0, gen3.LINEAR_M_S, "speed")
        if not 0 <= angular <= gen3.ANGULAR_DEG_S:
            yield _error(TURNING, index, angular, 0, gen3.ANGULAR_DEG_S, "turning speed")
        if each.reference_frame != ReferenceFrame.BASE:
            yield _error(FRAME, index, each.reference_frame, ReferenceFrame.BASE, ReferenceFrame.BASE, "frame")
        if each.pose is None:
            yield _error(OUTSIDE, index, 0, 0, 0, "no pose")


def _of_radii(waypoints: list[CartesianWaypoint], joints: Joints) -> Iterator[TrajectoryError]:
    """Errors of blending radii: negative, at the last waypoint, or too large between two waypoints."""
    poses = [each.pose or Pose() for each in waypoints]
    points = np.array([gen3.tool(joints)[:3, 3], *([pose.x, pose.y, pose.z] for pose in poses)])
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    radii = [0.0, *(each.blending_radius for each in waypoints)]
    if radii[-1] != 0:
        yield _error(LAST_BLENDS, len(waypoints) - 1, radii[-1], 0, 0, "radius of the last waypoint")
    for index, length in enumerate(lengths):
        if radii[index + 1] < 0 or radii[index] + radii[index + 1] > length + 1e-6:
            yield _error(RADIUS, index, radii[index + 1], 0, float(length), "blending radius")


def _error(
    kind: int, waypoint: int, value: float, low: float, high: float, said: str, joint: int = 0
) -> TrajectoryError:
    return TrajectoryError(
        error_type=kind,
        error_value=float(value),
        min_value=float(low),
        max_value=float(high),
        index=joint,
        message=said,
        waypoint_index=waypoint,
    )
