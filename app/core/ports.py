"""Ports of a session to the world, as small protocols. Rigs, the console and the recorder implement them."""

from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path
from typing import Literal, Protocol, TypeVar

import anyio

from app.core.dialogue.approval import Approved
from app.core.dialogue.jog import Jog
from app.core.dialogue.requests import Request
from app.core.geometry.arm_geometry import ArmShape, JointAngles
from app.core.geometry.camera import CameraModel
from app.core.geometry.hand_eye import HandEye
from app.core.messages import ArmState, Executed, Frame, Message, Transition
from app.core.types import ToolPose

ResultT = TypeVar("ResultT")


class Clock(Protocol):
    """Time as a dependency: whoever runs a session brings the machine's, or one that waits for nothing."""

    def now(self) -> float:
        """Monotonic time [s]; later calls return later moments."""
        ...

    async def sleep(self, duration_s: float) -> None:
        """Wait."""
        ...

    def move_on_after(self, duration_s: float | None) -> anyio.CancelScope:
        """Cancel scope of what is given up after so long; None: never. Its deadline is in the event loop's time."""
        ...


class Computer(Protocol):
    """Place where heavy functions are computed, one at a time: a process of its own, or this one."""

    async def __aenter__(self) -> object:
        """Open it."""
        ...

    async def __aexit__(self, *_: object) -> None:
        """Give up what is being computed."""
        ...

    async def run(self, function: Callable[..., ResultT], *arguments: object) -> ResultT:
        """`function(*arguments)`; both must be picklable.

        Raises the DipacError that the function raises, and WorkerError where it raises anything else or takes too long.
        """
        ...


class Computers(Protocol):
    """Factory of computers: processes (`Worker`), unless somebody brings others."""

    def __call__(self, name: str, *, niceness: int = 0, deadline_s: float = ...) -> Computer:
        """A computer that yields to others by its niceness, and takes no longer for a call than `deadline_s`."""
        ...


class Camera(Protocol):
    """A source of RGB-D frames."""

    @property
    def model(self) -> CameraModel:
        """Its calibration."""
        ...

    @property
    def words(self) -> str:
        """Fault of the camera and the recovery under way, for an operator; empty where there is none."""
        ...

    async def read(self) -> Frame:
        """The next frame that is newer than the last one read.

        Raises DeviceError where none comes within the timeout of the site.
        """
        ...


class Posed(Protocol):
    """A source of arm poses, measured or replayed."""

    def tool(self) -> ToolPose:
        """Pose and opening of the tool now. May be called from any thread and never blocks."""
        ...

    def joints(self) -> JointAngles:
        """The joints' angles [rad] now. May be called from any thread and never blocks."""
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

    def tool(self) -> ToolPose:
        """Pose and opening of the tool as last measured. May be called from any thread and never blocks."""
        ...

    def joints(self) -> JointAngles:
        """The joints' angles [rad] as last measured. May be called from any thread and never blocks."""
        ...

    def jog(self, jog: Jog) -> bool:
        """Command a tool velocity; True where the arm accepts it, which it does only while `jogged` waits.

        Callable from any thread; never blocks. The arm decelerates to rest where no newer command comes within the
        watchdog's time, and before the workspace ends.
        """
        ...

    async def accept_jogs(self, over: anyio.Event | None = None) -> Executed | None:
        """Accept jogging and wait until it has ended: from the first jog to rest, and rest kept.

        It was not approved, so `approved_id` is an id of its own kind. A jog that lasts too long is ended, and `reason`
        says so; commands that go on are rejected until the next call. Once it is `over` no jog is accepted any more;
        None where nothing was moved by then. Cancelled, the arm comes to rest. Raises MotionRefused while a stop is in
        force and DeviceError where the arm's process is gone. A stop in the middle is an outcome, not an error.
        """
        ...

    def stop(self) -> None:
        """Stop now. Callable from any thread, never blocks, works in every mode; stays in force until `reset`."""
        ...

    @property
    def held(self) -> bool:
        """True while a `stop` is in force; False where the arm's own process stopped it. Never blocks."""
        ...

    async def reset(self, *, asked_s: float) -> None:
        """Lift a stop or a fault, so that motions are accepted again; `asked_s` is the time of the request [s].

        A stop that came after `asked_s` stays in force. Raises DeviceError then, and where the arm does not answer.
        """
        ...


class Rig(Protocol):
    """Cameras and an arm that look at and act on the same table."""

    @property
    def name(self) -> str:
        """Name for the log and the console."""
        ...

    @property
    def simulated(self) -> bool:
        """True where nothing real can move: automatic approval is allowed here alone."""
        ...

    @property
    def shape(self) -> ArmShape | None:
        """Geometry of `seen_arm` and its tool, so that they are not taken for the object. None where unknown."""
        ...

    @property
    def seen_arm(self) -> Posed:
        """The arm in the cameras' images: `arm`, unless the images were recorded."""
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
    """The decision maker: the console, or automatic approval."""

    def show(self, message: Message) -> None:
        """Show a message to the operator. Never blocks."""
        ...

    def requests(self) -> AsyncIterator[Request]:
        """The operator's requests, in order."""
        ...


class Recorder(Protocol):
    """The log of an episode."""

    async def write(self, message: Message) -> None:
        """Append a message; encoding happens off the event loop."""
        ...


class CameraShelf(Protocol):
    """Store of camera calibrations."""

    async def kept(self, serial: str) -> HandEye | None:
        """The camera's latest stored calibration. Raises RecordingError where it cannot be read."""
        ...

    async def keep(self, found: HandEye) -> Path:
        """Store it in place of the last one; returns its path. Raises UsageError where it cannot be written."""
        ...


class Studio(Protocol):
    """Files beside the session's own recording: demonstrations, and clips of the recent past."""

    async def begin(self, opening: Callable[[], Sequence[Message]]) -> Path:
        """Start a file that begins with the messages of `opening`, and receives everything recorded from now on.

        Raises PreflightError where it does not fit on the disk, and RecordingError where one is open.
        """
        ...

    async def end(self, said: Literal["success", "failure"] | None, *, operator: str) -> None:
        """Close the file with its label; None removes it: its content is in the session's own recording.

        Raises RecordingError where none is open, or it cannot be written.
        """
        ...

    async def demonstration(self, recording: str) -> tuple[str, Sequence[Transition]]:
        """Task and motions of a demonstration beside the session's recording, by its file's name.

        Raises UsageError where there is none of that name, and RecordingError where it cannot be read.
        """
        ...

    async def clip(self, duration_s: float) -> Path:
        """The last `duration_s` of the session's recording as a file of its own.

        Raises RecordingError where it cannot be written.
        """
        ...
