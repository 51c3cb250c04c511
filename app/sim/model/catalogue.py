"""Finds the effects: every module of `app.sim.effects` except `base` offers one as `EFFECT`."""

from app.sim import effects
from app.sim.effects.base import Effect
from app.sim.files import files_of


def discover() -> dict[str, Effect]:
    """All effects by file name, in alphabetical order.

    Raises TypeError where a file of the folder offers no `EFFECT`.
    """
    found: dict[str, Effect] = {}
    for name, module in files_of(effects):
        effect = getattr(module, "EFFECT", None)
        if not isinstance(effect, Effect):
            raise TypeError(f"app/sim/effects/{name}.py must define EFFECT, an instance of Effect.")
        found[name] = effect
    return found


EFFECTS = tuple(discover().values())
