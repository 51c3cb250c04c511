"""What the flow needs of the world, as small protocols. Rigs, the console and the recorder provide them."""

from collections.abc import AsyncIterator, Sequence
from typing import Protocol

from app.core.approval import Approved
from app.core.control import Lease
from app.core.messages import (
    ArmState,
    CameraModel,
    Decision,
    Executed,
    Frame,
    Message,
    Notice,
    ResumeRequest,
    StopRequest,
)


class Clock(Protocol):
    """Time as a dependency, so that a replay can bring its own."""

    def now(self) -> float:
        """Monotonic time [s]."""
        ...

    async def sleep(self, duration_s: float) -> None:
        """Wait."""
        ...


class Camera(Protocol):
    """A source of RGB-D frames."""

    @property
    def model(self) -> CameraModel:
        """Its calibration."""
        ...

    async def read(self) -> Frame:
        """The next frame that is newer than the last one read.

        Raises DeviceError where none comes in the time the site allows.
        """
        ...


class Arm(Protocol):
    """An arm in a process of its own, with its own watchdog."""

    async def state(self) -> ArmState:
        """The arm as last measured."""
        ...

    async def execute(self, approved: Approved) -> Executed:
        """Make the approved motion and wait for its end; feeds the arm's watchdog meanwhile.

        Raises MotionRefused before anything moves (limits, workspace, a stop in force) and DeviceError where the arm's
        process is gone. A stop in the middle is an outcome, not an error.
        """
        ...

    def stop(self) -> None:
        """Stop now. May be called from any thread, never blocks, works in every mode; stays in force until `reset`."""
        ...

    async def reset(self, *, asked_s: float) -> None:
        """Lift a stop or a fault, so that motions are accepted again; `asked_s` is when somebody asked for it [s].

        A stop that came after `asked_s` stays in force. Raises DeviceError then, and where the arm does not answer.
        """
        ...


class Rig(Protocol):
    """Cameras and an arm that look at and act on the same table."""

    @property
    def name(self) -> str:
        """For the log and the console."""
        ...

    @property
    def simulated(self) -> bool:
        """Whether nothing real can move: automatic approval is allowed here alone."""
        ...

    @property
    def cameras(self) -> Sequence[Camera]:
        """Two or more views."""
        ...

    @property
    def arm(self) -> Arm:
        """The one arm."""
        ...


class Operator(Protocol):
    """Whoever decides: the console, or automatic approval."""

    def show(self, message: Message) -> None:
        """Put a message before the operator. Never blocks."""
        ...

    def requests(self) -> AsyncIterator[Decision | StopRequest | ResumeRequest | Lease | Notice]:
        """What the operator asks for, in order."""
        ...


class Recorder(Protocol):
    """The log of an episode."""

    async def write(self, message: Message) -> None:
        """Append a message; encoding happens off the event loop."""
        ...
