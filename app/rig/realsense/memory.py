"""Shared memory of a capture process and the application: images, reports and commands, without locks."""

import time
from dataclasses import asdict, dataclass
from typing import Any, Literal, TypeAlias, final

import numpy as np

from app.core.shared_memory_camera import image_ring
from app.core.system.ring import Ring, Stamp
from app.core.types import ColourImage, DepthImage, Intrinsics
from app.rig.realsense.recovery_policy import Step
from app.rig.realsense.settings import StreamSettings

Command: TypeAlias = Literal["open", "reset"]
_COMMANDS: tuple[Command, ...] = ("open", "reset")

_IMAGES_KEPT = 8
"""Capacity of the ring of images: a quarter of a second at 30 Hz for a delayed reader to copy one."""
_REPORTS_KEPT = 16
_REPORT = np.dtype([("command", "i8"), ("step", "U16"), ("absent", "?"), ("text", "U400")])
_IDENTITY = np.dtype(
    [
        ("name", "U64"),
        ("serial", "U64"),
        ("firmware", "U32"),
        ("usb", "U16"),
        ("warning", "U400"),
        ("K", "f8", (3, 3)),
        ("depth_unit_m", "f8"),
    ]
)
_ARRIVAL = np.dtype([("time_s", "f8"), ("arrival_s", "f8"), ("error_s", "f8"), ("domain", "U16"), ("by", "U16")])


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class CaptureReport:
    """Last report of a capture process: `step`, for the command of this number, and the reason where it failed."""

    command: int
    step: Step
    absent: bool
    text: str


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Identity:
    """Identity of an opened camera; `K` [pixel] of its images, `warning` about its connection."""

    name: str
    serial: str
    firmware: str
    usb: str
    K: Intrinsics
    depth_unit_m: float
    warning: str


@final
@dataclass(frozen=True, kw_only=True)
class Arrived:
    """Timestamps of an image in monotonic time [s]: exposed at `time_s`, within `error_s`, received at `arrival_s`.

    `domain`: clock of its stamp; `by`: source of its date, the calendar or its arrival.
    """

    time_s: float
    arrival_s: float
    error_s: float
    domain: str
    by: str


@final
class CaptureMemory:
    """Memory passed to a capture process as it is started, and to its replacement."""

    def __init__(self, settings: StreamSettings) -> None:
        self.images = image_ring(settings.width, settings.height, kept=_IMAGES_KEPT)
        self.closing, self._told, self._pulse = Stamp(), Stamp(), Stamp()
        self._reports, self._identities = Ring(_REPORT, _REPORTS_KEPT), Ring(_IDENTITY, _REPORTS_KEPT)
        self._arrivals = Ring(_ARRIVAL, _REPORTS_KEPT)

    def tell(self, command: Command) -> int:
        """Publish a command for the process; returns its number."""
        number = self._told.value // len(_COMMANDS) + 1
        self._told.value = number * len(_COMMANDS) + _COMMANDS.index(command)
        return number

    @property
    def last_command(self) -> tuple[int, Command]:
        """The last command and its number."""
        number, which = divmod(self._told.value, len(_COMMANDS))
        return number, _COMMANDS[which]

    def beat(self) -> None:
        """Record a heartbeat."""
        self._pulse.value = time.monotonic_ns()

    @property
    def pulse_s(self) -> float:
        """Time of the last heartbeat, monotonic [s]."""
        return self._pulse.value / 1e9

    @property
    def image_s(self) -> float:
        """Arrival of the newest image, monotonic [s]; -inf before the first."""
        return self.arrival.arrival_s if self.arrival else float("-inf")

    def arrive(self, arrived: Arrived, color: ColourImage, depth: DepthImage) -> None:
        """Publish a pair of images."""
        self.images.append(time_s=arrived.time_s, color=color, depth=depth)
        self._arrivals.append(**asdict(arrived))

    @property
    def arrival(self) -> Arrived | None:
        """Timestamps of the newest image; None before the first."""
        record: Any = self._arrivals.newest()
        if record is None:
            return None
        time_s, arrival_s, error_s = (float(record[name]) for name in ("time_s", "arrival_s", "error_s"))
        return Arrived(
            time_s=time_s, arrival_s=arrival_s, error_s=error_s, domain=str(record["domain"]), by=str(record["by"])
        )

    def report(self, report: CaptureReport) -> None:
        """Publish the current step."""
        self.beat()
        self._reports.append(command=report.command, step=report.step, absent=report.absent, text=report.text)

    @property
    def last_report(self) -> CaptureReport | None:
        """The last report."""
        record: Any = self._reports.newest()
        if record is None:
            return None
        return CaptureReport(
            command=int(record["command"]),
            step=str(record["step"]),  # pyright: ignore[reportArgumentType] - as it was written
            absent=bool(record["absent"]),
            text=str(record["text"]),
        )

    def introduce(self, identity: Identity) -> None:
        """Publish the identity of the camera."""
        self._identities.append(
            name=identity.name,
            serial=identity.serial,
            firmware=identity.firmware,
            usb=identity.usb,
            K=identity.K,
            depth_unit_m=identity.depth_unit_m,
            warning=identity.warning,
        )

    @property
    def identity(self) -> Identity | None:
        """Identity of the camera when it was last opened."""
        record: Any = self._identities.newest()
        if record is None:
            return None
        names = ("name", "serial", "firmware", "usb", "warning")
        said = {name: str(record[name]) for name in names}
        return Identity(**said, K=np.array(record["K"]), depth_unit_m=float(record["depth_unit_m"]))
