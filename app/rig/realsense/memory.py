"""What a capture process shares with the application: images, what it does, and what it is told. Nobody waits."""

import time
from dataclasses import asdict, dataclass
from typing import Any, Literal, TypeAlias, final

import numpy as np

from app.core.ring import Ring, Stamp
from app.core.types import ColourImage, DepthImage, Intrinsics
from app.core.view import image_ring
from app.rig.realsense.ladder import Step
from app.rig.realsense.settings import Settings

Command: TypeAlias = Literal["open", "reset"]
_COMMANDS: tuple[Command, ...] = ("open", "reset")

_IMAGES_KEPT = 8
"""A quarter of a second at 30 Hz: a reader that is held up has so long to copy one."""
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
class Report:
    """What a capture process last said of itself: `step`, for the command of this number, and why that failed."""

    command: int
    step: Step
    absent: bool
    text: str


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Identity:
    """What a camera said as it was opened; `K` [pixel] of its images, `warning` of how it is connected."""

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
    """An image's dates in monotonic time [s]: taken at `time_s`, within `error_s`, and there at `arrival_s`.

    `domain`: what clock its stamp was of; `by`: what dated it, the calendar or its arrival.
    """

    time_s: float
    arrival_s: float
    error_s: float
    domain: str
    by: str


@final
class CaptureMemory:
    """Passed to a capture process as it is started, and to the next one where that is replaced."""

    def __init__(self, settings: Settings) -> None:
        self.images = image_ring(settings.width, settings.height, kept=_IMAGES_KEPT)
        self.closing, self._told, self._pulse = Stamp(), Stamp(), Stamp()
        self._reports, self._identities = Ring(_REPORT, _REPORTS_KEPT), Ring(_IDENTITY, _REPORTS_KEPT)
        self._arrivals = Ring(_ARRIVAL, _REPORTS_KEPT)

    def tell(self, command: Command) -> int:
        """Leave a command for the process; its number."""
        number = self._told.value // len(_COMMANDS) + 1
        self._told.value = number * len(_COMMANDS) + _COMMANDS.index(command)
        return number

    @property
    def told(self) -> tuple[int, Command]:
        """The last command and its number."""
        number, which = divmod(self._told.value, len(_COMMANDS))
        return number, _COMMANDS[which]

    def beat(self) -> None:
        """A sign of life."""
        self._pulse.value = time.monotonic_ns()

    @property
    def pulse_s(self) -> float:
        """When the last sign of life was given, in monotonic time [s]."""
        return self._pulse.value / 1e9

    @property
    def image_s(self) -> float:
        """When the newest image came, in monotonic time [s]; -inf before the first."""
        return self.arrived.arrival_s if self.arrived else float("-inf")

    def arrive(self, arrived: Arrived, color: ColourImage, depth: DepthImage) -> None:
        """Leave a pair of images."""
        self.images.append(time_s=arrived.time_s, color=color, depth=depth)
        self._arrivals.append(**asdict(arrived))

    @property
    def arrived(self) -> Arrived | None:
        """What is known of the newest image; None before the first."""
        record: Any = self._arrivals.newest()
        if record is None:
            return None
        time_s, arrival_s, error_s = (float(record[name]) for name in ("time_s", "arrival_s", "error_s"))
        return Arrived(
            time_s=time_s, arrival_s=arrival_s, error_s=error_s, domain=str(record["domain"]), by=str(record["by"])
        )

    def report(self, report: Report) -> None:
        """Say what is being done."""
        self.beat()
        self._reports.append(command=report.command, step=report.step, absent=report.absent, text=report.text)

    @property
    def reported(self) -> Report | None:
        """What was last said."""
        record: Any = self._reports.newest()
        if record is None:
            return None
        return Report(
            command=int(record["command"]),
            step=str(record["step"]),  # pyright: ignore[reportArgumentType] - as it was written
            absent=bool(record["absent"]),
            text=str(record["text"]),
        )

    def introduce(self, identity: Identity) -> None:
        """Say which camera this is."""
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
        """Which camera this was when it was last opened."""
        record: Any = self._identities.newest()
        if record is None:
            return None
        names = ("name", "serial", "firmware", "usb", "warning")
        said = {name: str(record[name]) for name in names}
        return Identity(**said, K=np.array(record["K"]), depth_unit_m=float(record["depth_unit_m"]))
