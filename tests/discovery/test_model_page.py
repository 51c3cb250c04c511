"""The page of equations names functions that there are."""

import importlib
import pkgutil
import re
from pathlib import Path

import pytest

from app import discovery, sim

PAGE = Path(__file__).parents[2] / "docs" / "discovery-model.md"
MODULES = {
    module.name.rsplit(".", 1)[1]: module.name
    for package in (sim, discovery)
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    if not module.ispkg
}
NAMED = sorted(set(re.findall(r"`(\w+)\.(\w+)[^`]*`", PAGE.read_text(encoding="utf-8"))))


@pytest.mark.parametrize(("module", "name"), [pair for pair in NAMED if pair[1] not in ("py", "json", "md")])
def test_what_the_page_names_is_in_the_program(module: str, name: str) -> None:
    if module in MODULES:
        assert hasattr(importlib.import_module(MODULES[module]), name)
    else:
        homes = [importlib.import_module(home) for home in MODULES.values()]
        assert any(hasattr(getattr(home, module, None), name) for home in homes), f"{module}.{name}"
