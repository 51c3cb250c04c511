"""Names of effects, parameters and motions in words; effects and parameters are spelt as their files say."""

import re
from collections.abc import Mapping
from functools import cache
from typing import Final

from app.discovery import sensor_actuator_errors
from app.sim import effects
from app.sim.effects.base import ObjectKind
from app.sim.files import files_of

_MOTIONS: Final[Mapping[ObjectKind, tuple[str, str]]] = {
    "rope": ("push", "pushes"),
    "grains": ("sweep", "sweeps"),
    "cloth": ("carry", "carries"),
    "liquid": ("pour", "pours"),
    "soup": ("pour", "pours"),
}


def motion_name(kind: ObjectKind, *, count: int = 1) -> str:
    """One motion of the tool, or several, by the kind of object, as in `push` and `carries`."""
    one, several = _MOTIONS[kind]
    return one if count == 1 else several


def effect_name(effect: str) -> str:
    """An effect's or parameter's id in words, as in `hand-eye translation`."""
    words = effect
    for part, spelling in _spellings().items():
        words = re.sub(rf"(^|_){part}(?=_|$)", rf"\g<1>{spelling}", words)
    return words.replace("_", " ")


@cache
def _spellings() -> Mapping[str, str]:
    """Parts of the names that are names or compounds, as people write them."""
    files = [*files_of(effects), *files_of(sensor_actuator_errors)]
    return dict(spelling for _, module in files if (spelling := module.EFFECT.spelling) is not None)
