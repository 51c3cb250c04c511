"""What a kind of object has to offer to a simulated cell."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np

from app.core.motion import pointing_down
from app.core.stage import Stage
from app.core.types import ToolPose
from app.rig.simulated.physics import HOME_TOOL_M
from app.rig.simulated.shapes import Surface
from app.rig.simulated.world import Nodes, World

Build: TypeAlias = Callable[[Stage, Nodes, float], World]
"""A world with the object where a task starts it, its tool at home, whose time begins then [s]."""


def _away(stage: Stage, start: Nodes) -> ToolPose:
    """Over the near edge of the table, pointing down."""
    del stage, start
    return pointing_down(np.array(HOME_TOOL_M))


@final
@dataclass(frozen=True, kw_only=True)
class Kind:
    """`body`: the class in `app.core.stage` that it is about.

    `node_count` of the worlds that `build` makes, and `surfaces`, the object at its nodes as cameras see it; `home`,
    where the arm waits with its tool for the first motion.
    """

    body: type
    node_count: Callable[[Stage], int]
    build: Build
    surfaces: Callable[[Stage, Nodes], list[Surface]]
    home: Callable[[Stage, Nodes], ToolPose] = _away
