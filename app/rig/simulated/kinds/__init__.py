"""One file a kind of object: what it does in a simulated world, and what it looks like. The folder is the list."""

import importlib
import pkgutil
from functools import lru_cache

from app.core.stage import Stage
from app.rig.simulated.kind import Kind


def kind_of(stage: Stage) -> Kind:
    """The kind of the stage's object. Raises TypeError where no file here is about it."""
    kinds = _kinds()
    if type(stage.body) not in kinds:
        known = ", ".join(sorted(body.__name__ for body in kinds))
        raise TypeError(f"No file of app/rig/simulated/kinds is about a {type(stage.body).__name__}; known: {known}.")
    return kinds[type(stage.body)]


@lru_cache
def _kinds() -> dict[type, Kind]:
    """What every file of this folder defines as `KIND`, by the class in `app.core.stage` that it is about."""
    modules = [importlib.import_module(f"{__name__}.{each.name}") for each in pkgutil.iter_modules(__path__)]
    return {module.KIND.body: module.KIND for module in modules}
