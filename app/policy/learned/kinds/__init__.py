"""The ways to learn a policy, one file each, named as `dipac train --policy` names it; each defines `LEARNER`."""

from __future__ import annotations

import importlib
import pkgutil
from typing import TYPE_CHECKING

from app.core.errors import UsageError

if TYPE_CHECKING:  # Whoever needs the names alone shall not load JAX for them.
    from app.policy.learned.base import Learner


def names() -> list[str]:
    """The files of this folder."""
    return sorted(module.name for module in pkgutil.iter_modules(__path__))


def load(name: str) -> Learner:
    """The learner of that name. Raises UsageError with the known ones."""
    if name not in names():
        raise UsageError.unknown("policy", name, names())
    learner: Learner = importlib.import_module(f"{__name__}.{name}").LEARNER
    return learner
