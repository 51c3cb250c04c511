"""Finds the effects: every module of `app.sim.effects` except `base` offers one as `EFFECT`."""

import importlib
import pkgutil

from app.sim import effects
from app.sim.effects.base import Effect


def discover() -> dict[str, Effect]:
    """All effects by file name, in alphabetical order.

    Raises TypeError where a file of the folder offers no `EFFECT`.
    """
    found: dict[str, Effect] = {}
    for name in sorted(module.name for module in pkgutil.iter_modules(effects.__path__) if module.name != "base"):
        effect = getattr(importlib.import_module(f"{effects.__name__}.{name}"), "EFFECT", None)
        if not isinstance(effect, Effect):
            raise TypeError(f"app/sim/effects/{name}.py must define EFFECT, an instance of Effect.")
        found[name] = effect
    return found


EFFECTS = tuple(discover().values())
