"""What a kind of object has to offer to a simulated cell."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias, final

from app.core.stage import Stage
from app.rig.simulated.shapes import Surface
from app.rig.simulated.world import Nodes, World

Build: TypeAlias = Callable[[Stage, Nodes, float], World]
"""A world with the object where a task starts it, its tool at home, whose time begins then [s]."""


@final
@dataclass(frozen=True, kw_only=True)
class Kind:
    """`body`: the class in `app.core.stage` that it is about.

    `node_count` of the worlds that `build` makes, and `surfaces`, the object at its nodes as cameras see it.
    """

    body: type
    node_count: Callable[[Stage], int]
    build: Build
    surfaces: Callable[[Stage, Nodes], list[Surface]]
