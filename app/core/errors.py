"""Every error this program raises on purpose, in one tree.

Each message is one line that says what is wrong, names the alternatives and the next step; the command line prints it
and exits with `exit_code`.
"""

import difflib
from collections.abc import Iterable
from typing import ClassVar, Self

from app.core.rejection_codes import Refusal


class DipacError(Exception):
    """The root of the tree."""

    exit_code: ClassVar[int] = 1


class UsageError(DipacError):
    """The user asked for something that is not there: a task, method, camera, file or value."""

    exit_code = 2

    @classmethod
    def unknown(cls, kind: str, given: str, known: Iterable[str]) -> Self:
        """An error that names the alternatives, the likeliest first."""
        names = sorted(known)
        near = difflib.get_close_matches(given, names, n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        return cls(f"Unknown {kind} {given!r}.{hint} Known: {', '.join(names) or 'none'}.")


class ParameterError(UsageError):
    """A number is non-finite or outside its range."""


class PreflightError(DipacError):
    """The program cannot start: a busy port, an unwritable folder, a full disk, a missing library."""

    exit_code = 3


class RecordingError(DipacError):
    """A recording is corrupt, truncated or of a kind that this version cannot read."""

    exit_code = 4


class PerceptionError(DipacError):
    """The images hold no usable object: an empty cloud, too few points, every view stale."""

    exit_code = 5


class PlanningError(DipacError):
    """No plan can be made: every branch is non-finite, or the goal is out of reach."""

    exit_code = 6


class SimulationError(DipacError):
    """The particle simulator met a state that it must not go on from."""

    exit_code = 7


class MemoryPlanError(SimulationError):
    """A rollout does not fit into memory; the message says how many candidates would."""


class DeviceError(DipacError):
    """A camera or the arm did not do what was asked in the time it was given."""

    exit_code = 8


class MotionRefused(DeviceError):
    """The arm will not make this motion: outside the workspace, too fast, not approved, or it is stopped."""

    def __init__(self, code: Refusal, sentence: str) -> None:
        super().__init__(f"{sentence} [{code}]")
        self.code, self.sentence = code, sentence


class ApprovalRefused(DipacError):
    """A proposal may not be approved any more: it is not the one shown, it is old, or the object has moved."""

    exit_code = 9


class WorkerError(DipacError):
    """A worker process died or could not be started."""

    exit_code = 10


def first_error(group: BaseExceptionGroup[BaseException]) -> BaseException:
    """The first error of this program in a group that tasks raised together; where there is none, the first of all."""
    ours, _ = group.split(DipacError)
    error: BaseException = ours or group
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return error
