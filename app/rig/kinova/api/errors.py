"""Errors between this program and an arm, each a `DeviceError`."""

from typing import final

from app.core.errors import DeviceError
from app.rig.kinova.api.error_messages import refusal


class WireError(DeviceError):
    """Bytes that are no message of this protocol, or a message that does not fit into bytes."""


class LinkLost(DeviceError):
    """The connection to the arm is gone, or was never there; `open` makes a new one."""


class NoAnswer(LinkLost):
    """A call was not answered in its time."""


@final
class Refused(DeviceError):
    """The arm answered a call with an error; `code` and `sub_code` are those of Kinova's `Errors.proto`."""

    def __init__(self, call: str, code: int, sub_code: int, said: str = "") -> None:
        super().__init__(f"The arm refused {call}: {refusal(sub_code, said)}")
        self.code, self.sub_code = code, sub_code
