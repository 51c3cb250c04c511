"""Enumerations of the Kortex protocol, as far as this program uses them.

Numbers: Kinovarobotics/ros_kortex, kortex_driver/protos (`Base.proto`, `Common.proto`, `ControlConfig.proto`).
"""

from enum import IntEnum


class ArmStateCode(IntEnum):
    """Whether the arm can be commanded; `Common.ArmState`."""

    UNSPECIFIED = 0
    BASE_INITIALIZATION = 1
    IDLE = 2
    INITIALIZATION = 3
    IN_FAULT = 4
    MAINTENANCE = 5
    SERVOING_LOW_LEVEL = 6
    SERVOING_READY = 7
    SERVOING_PLAYING_SEQUENCE = 8
    SERVOING_MANUALLY_CONTROLLED = 9
    BRAKE_RELEASING = 10


class ServoingMode(IntEnum):
    """Who closes the loop: the arm itself (single level), or a client at 1 kHz."""

    SINGLE_LEVEL = 2
    LOW_LEVEL = 3
    BYPASS = 4


class ReferenceFrame(IntEnum):
    """In which frame a pose or a twist is given. MIXED: linear as the base, angular as the tool."""

    MIXED = 1
    TOOL = 2
    BASE = 3


class ActionEvent(IntEnum):
    """What happened to an action."""

    END = 1
    ABORT = 2
    PAUSE = 3
    START = 4
    PREPROCESS_START = 5
    PREPROCESS_ABORT = 6
    PREPROCESS_END = 7


class GripperMode(IntEnum):
    """How a gripper is commanded. As a speed, above 0 opens; as a position, 0 is open and 1 closed."""

    SPEED = 2
    POSITION = 3


class ControlMode(IntEnum):
    """What a soft limit holds for."""

    CARTESIAN_JOYSTICK = 2
    CARTESIAN_TRAJECTORY = 5
    CARTESIAN_WAYPOINT_TRAJECTORY = 12


class Shape(IntEnum):
    """Of a protection zone; its dimensions [m] are radius and height, radius, or the three edges."""

    CYLINDER = 1
    SPHERE = 2
    RECTANGULAR_PRISM = 3
