"""The full name of the task that a command line asks for: its object, its tool, and how that object is simulated."""

import tomllib
from pathlib import Path
from typing import Any, Literal, TypeAlias

from app.core.errors import UsageError
from app.core.task_name import TaskName
from app.recording.model_file import task_of
from app.tasks import load, named
from app.tasks.sizes import SIZES

Dynamics: TypeAlias = Literal["rods", "mpm"]


def full_name(task: str, *, dynamics: Dynamics | None, sizes: Path | None = None, model: Path | None = None) -> str:
    """Of `task` with the sizes in a file, and with these dynamics: None takes those of `model`, or the task's own.

    A model of the same task says its sizes, too, where no file does. Raises UsageError for a task, size or dynamics
    that do not exist.
    """
    load(task)
    name = TaskName.parse(task)
    if sizes is not None:
        task = str(TaskName.of(name.problem, dict(name.sizes) | read_sizes(sizes)))
    if model is not None and dynamics is None and "@" not in task:
        known = task_of(model)
        its = TaskName.parse(known)
        if its.problem == name.problem and not TaskName.parse(task).sizes:
            return known
        dynamics = "rods" if its.dynamics == "rods" else "mpm"
    return named(task, dynamics)


def read_sizes(path: Path) -> dict[str, float]:
    """Sizes in a TOML file such as `length_m = 0.3`, by the names of `app.tasks.sizes.SIZES`.

    Raises UsageError where it cannot be read, or says anything else.
    """
    try:
        table: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"Cannot read the object {path}: {error.strerror}.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{path} is no TOML file ({error}); write lines such as `length_m = 0.3`.") from None
    for name, value in table.items():
        if name not in SIZES:
            raise UsageError.unknown(f"size in {path}", name, SIZES)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise UsageError(f"{path}: {name} = {value!r} is no number; write such as `{name} = {SIZES[name][0]}`.")
    return {name: float(value) for name, value in table.items()}
