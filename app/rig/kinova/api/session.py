"""Messages about sessions, and about the arm's state and mode.

Field numbers: pitt-rnel/kortex, protos (`Session.proto`, `Frame.proto`); Kinovarobotics/ros_kortex,
kortex_driver/protos (`Base.proto`, `Common.proto`). Fields that this program does not use are skipped when read.
"""

from dataclasses import dataclass
from typing import Annotated, final

from app.rig.kinova.api.protobuf import Field


@final
@dataclass(frozen=True, kw_only=True)
class Empty:
    """A call without arguments, or an answer without content."""


@final
@dataclass(frozen=True, kw_only=True)
class SessionInfo:
    """Credentials of a session, and the silence [ms] after which it is closed, or its motions are stopped."""

    username: Annotated[str, Field(1, "string")] = ""
    session_inactivity_timeout: Annotated[int, Field(2, "uint32")] = 0
    password: Annotated[str, Field(3, "string")] = ""
    connection_inactivity_timeout: Annotated[int, Field(4, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class Connection:
    """A session of the arm that caused an event."""

    connection_information: Annotated[str, Field(2, "string")] = ""
    connection_identifier: Annotated[int, Field(3, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class NotificationOptions:
    """Request for notifications of a topic as events occur: `type` 3."""

    type: Annotated[int, Field(1, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class Handle:
    """Handle of an object created on the arm."""

    identifier: Annotated[int, Field(1, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class ServoingModeInformation:
    """A `ServoingMode`."""

    servoing_mode: Annotated[int, Field(1, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class ArmStateInformation:
    """An `ArmStateCode`, and the connection whose command led to it."""

    active_state: Annotated[int, Field(1, "uint32")] = 0
    connection: Annotated[Connection | None, Field(2, "message")] = None


@final
@dataclass(frozen=True, kw_only=True)
class ArmStateNotification:
    """Notification of a new `ArmStateCode`."""

    active_state: Annotated[int, Field(1, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class ErrorReply:
    """Payload of an answer whose error bits are set (`Frame.proto`)."""

    error_code: Annotated[int, Field(1, "uint32")] = 0
    error_sub_code: Annotated[int, Field(2, "uint32")] = 0
    error_sub_string: Annotated[str, Field(3, "string")] = ""
