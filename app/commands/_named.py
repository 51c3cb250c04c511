"""The full name of the task that a command line asks for: its object, its tool, and how that object is simulated."""

from pathlib import Path
from typing import Literal, TypeAlias

from app.core.errors import UsageError
from app.core.task_name import TaskName
from app.recording.exchange.model_file import task_of
from app.recording.exchange.toml_file import finite_number, read_toml
from app.tasks import load, name_with_dynamics
from app.tasks.elements.sizes import BEAN_SIZES, SIZES

Dynamics: TypeAlias = Literal["rods", "mpm"]


def full_name(task: str, *, dynamics: Dynamics | None, sizes: Path | None = None, model: Path | None = None) -> str:
    """Full name of `task` with the sizes in a file, and with these dynamics.

    What neither the name nor the caller specifies is that of `model` if it is of the same task, else the task's own.
    Raises UsageError for an unknown task, size or dynamics, and if name and `dynamics` contradict.
    """
    load(task)
    name = TaskName.parse(task)
    engine: str | None = name.dynamics if "@" in task else None
    if None not in (engine, dynamics) and engine != dynamics:
        raise UsageError(f"{task} contradicts --dynamics {dynamics}; leave one of them out.")
    engine, own = engine or dynamics, dict(name.sizes) | (read_sizes(sizes) if sizes else {})
    if model is not None:
        its = TaskName.parse(task_of(model))
        if its.problem == name.problem:
            engine, own = engine or its.dynamics, own or dict(its.sizes)
    return name_with_dynamics(str(TaskName.of(name.problem, own)), engine)


def read_sizes(path: Path) -> dict[str, float]:
    """Sizes in a TOML file such as `length_m = 0.3`, by the names of `app.tasks.elements.sizes`.

    Raises UsageError where it cannot be read, or says anything else.
    """
    try:
        table = read_toml(path)
    except OSError as error:
        raise UsageError(f"Cannot read the object {path}: {error.strerror}.") from None
    except ValueError as error:
        raise UsageError(f"{path} is no TOML file ({error}); write lines such as `length_m = 0.3`.") from None
    for name in table:
        if name not in SIZES | BEAN_SIZES:
            raise UsageError.unknown(f"size in {path}", name, SIZES | BEAN_SIZES)
    try:
        return {name: finite_number(name, value) for name, value in table.items()}
    except ValueError as error:
        raise UsageError(f"{path}: {error}; write such as `length_m = 0.3`.") from None
