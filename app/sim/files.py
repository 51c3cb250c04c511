"""The modules of a folder whose files are found, and not listed: effects, materials, tools."""

import importlib
import pkgutil
from collections.abc import Iterator
from types import ModuleType


def files_of(package: ModuleType) -> Iterator[tuple[str, ModuleType]]:
    """Modules of a folder with their files' names, in alphabetical order, without `base`."""
    for name in sorted(module.name for module in pkgutil.iter_modules(package.__path__) if module.name != "base"):
        yield name, importlib.import_module(f"{package.__name__}.{name}")
