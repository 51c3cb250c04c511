"""One file for each task with random motions and hidden effects, named as the task. The folder is the list."""

import importlib
import pkgutil
from functools import lru_cache

from app.core.errors import UsageError
from app.rig.simulated.testbeds.base import Testbed
from app.tasks.elements.base import Task

_INTERFACE = "base"


def find_testbed(task: Task) -> Testbed:
    """The task's file. Raises UsageError with those that there are where it has none."""
    found = _testbeds()
    if task.problem not in found:
        known = ", ".join(sorted(found))
        raise UsageError(f"{task.name}: nothing can be hidden in its world so far; choose another task: {known}.")
    return found[task.problem]


@lru_cache
def _testbeds() -> dict[str, Testbed]:
    """The `TESTBED` of every file of this folder, by its name."""
    names = [each.name for each in pkgutil.iter_modules(__path__) if each.name != _INTERFACE]
    return {name: importlib.import_module(f"{__name__}.{name}").TESTBED for name in names}
