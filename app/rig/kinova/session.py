"""Messages about sessions, and about the arm's state and mode.

Field numbers: pitt-rnel/kortex, protos (`Session.proto`, `Frame.proto`); Kinovarobotics/ros_kortex,
kortex_driver/protos (`Base.proto`, `Common.proto`). Fields that this program does not use are skipped when read.
"""

from dataclasses import dataclass
from typing import Annotated, final

from app.rig.kinova.protobuf import Field


@final
@dataclass(frozen=True, kw_only=True)
class Empty:
    """A call that says nothing, or an answer that is just there."""


@final
@dataclass(frozen=True, kw_only=True)
class SessionInfo:
    """Who asks for a session, and after how much silence [ms] it is closed, or what it moves is stopped."""

    username: Annotated[str, Field(1, "string")] = ""
    session_inactivity_timeout: Annotated[int, Field(2, "uint32")] = 0
    password: Annotated[str, Field(3, "string")] = ""
    connection_inactivity_timeout: Annotated[int, Field(4, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class Connection:
    """Who did something: a session of the arm."""

    connection_information: Annotated[str, Field(2, "string")] = ""
    connection_identifier: Annotated[int, Field(3, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class NotificationOptions:
    """That a topic is to be reported as things happen: `type` 3."""

    type: Annotated[int, Field(1, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class Handle:
    """What something that was made on the arm is called there."""

    identifier: Annotated[int, Field(1, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class ServoingModeInformation:
    """A `ServoingMode`."""

    servoing_mode: Annotated[int, Field(1, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class ArmStateInformation:
    """An `ArmStateCode`, and whose command led to it."""

    active_state: Annotated[int, Field(1, "uint32")] = 0
    connection: Annotated[Connection | None, Field(2, "message")] = None


@final
@dataclass(frozen=True, kw_only=True)
class ArmStateNotification:
    """The arm has come to this `ArmStateCode`."""

    active_state: Annotated[int, Field(1, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class ErrorReply:
    """What an answer carries whose error bits are set (`Frame.proto`)."""

    error_code: Annotated[int, Field(1, "uint32")] = 0
    error_sub_code: Annotated[int, Field(2, "uint32")] = 0
    error_sub_string: Annotated[str, Field(3, "string")] = ""
