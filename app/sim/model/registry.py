"""The materials and tools there are, by name: the classes in the files of their folders.

A name is that of the class without its suffix `Material` or `Collider`: `rope.Rope` is `RopeMaterial` of `rope.py`.
"""

from dataclasses import is_dataclass
from types import ModuleType

from app.sim import materials, tools
from app.sim.files import files_of
from app.sim.materials.base import Law


def known_materials() -> dict[str, type]:
    """Materials by `file.Name`: all classes with a `Law`."""
    return {name: kind for name, kind in _classes(materials).items() if isinstance(getattr(kind, "law", None), Law)}


def known_tools() -> dict[str, type]:
    """Tools by `file.Name`: all classes with primitives."""
    return {name: kind for name, kind in _classes(tools).items() if hasattr(kind, "primitives")}


def kind_name(kind: type) -> str:
    """Name of a material or tool, as dumps and messages have it."""
    return kind.__name__.removesuffix("Material").removesuffix("Collider")


def _classes(package: ModuleType) -> dict[str, type]:
    """The dataclasses that the files of a folder define, without `base`."""
    found: dict[str, type] = {}
    for file, module in files_of(package):
        for kind in vars(module).values():
            if isinstance(kind, type) and is_dataclass(kind) and kind.__module__ == module.__name__:
                found[f"{file}.{kind_name(kind)}"] = kind
    return found
