"""One file a kind of object: its simulation and its appearance. The folder is the list."""

import importlib
import pkgutil
from functools import lru_cache

from app.core.geometry.scene_description import Stage
from app.rig.simulated.worlds.kind import Kind


def kind_of(stage: Stage) -> Kind:
    """The kind of the stage's object. Raises TypeError where there is no file for it."""
    kinds = _kinds()
    if type(stage.body) not in kinds:
        known = ", ".join(sorted(body.__name__ for body in kinds))
        raise TypeError(f"No file of app/rig/simulated/kinds is about a {type(stage.body).__name__}; known: {known}.")
    return kinds[type(stage.body)]


@lru_cache
def _kinds() -> dict[type, Kind]:
    """The `KIND` of every file of this folder, by its class in `app.core.geometry.scene_description`."""
    modules = [importlib.import_module(f"{__name__}.{each.name}") for each in pkgutil.iter_modules(__path__)]
    return {module.KIND.body: module.KIND for module in modules}
