"""Enumerations of the Kortex protocol that this program uses.

Numbers: Kinovarobotics/ros_kortex, kortex_driver/protos (`Base.proto`, `Common.proto`, `ControlConfig.proto`).
"""

from enum import IntEnum


class ArmStateCode(IntEnum):
    """State of the arm, commandable or not; `Common.ArmState`."""

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
    """Servoing mode: the arm closes the loop itself (single level), or a client does at 1 kHz."""

    SINGLE_LEVEL = 2
    LOW_LEVEL = 3
    BYPASS = 4


class ReferenceFrame(IntEnum):
    """Reference frame of a pose or twist. MIXED: linear parts in the base's axes, angular in the tool's."""

    MIXED = 1
    TOOL = 2
    BASE = 3


class ActionEvent(IntEnum):
    """Event of an action's progress."""

    END = 1
    ABORT = 2
    PAUSE = 3
    START = 4
    PREPROCESS_START = 5
    PREPROCESS_ABORT = 6
    PREPROCESS_END = 7


class GripperMode(IntEnum):
    """Command mode of a gripper. As a speed, above 0 opens; as a position, 0 is open and 1 closed."""

    SPEED = 2
    POSITION = 3


class ControlMode(IntEnum):
    """Control mode that a soft limit applies to."""

    CARTESIAN_JOYSTICK = 2
    CARTESIAN_TRAJECTORY = 5
    CARTESIAN_WAYPOINT_TRAJECTORY = 12


class ShapeType(IntEnum):
    """Shape of a protection zone; its dimensions [m] are radius and height, radius, or the three edges."""

    CYLINDER = 1
    SPHERE = 2
    RECTANGULAR_PRISM = 3
