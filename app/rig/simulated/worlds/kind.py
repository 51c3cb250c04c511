"""Interface of a kind of object in a simulated cell."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, final

import numpy as np

from app.core.geometry.scene_description import Stage
from app.core.motion import pointing_down
from app.core.types import ToolPose
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.physics import HOME_TOOL_M, WorldPhysics
from app.rig.simulated.worlds.shapes import Surface
from app.rig.simulated.worlds.world import Nodes, World


class Build(Protocol):
    """Constructor of a world."""

    def __call__(
        self,
        stage: Stage,
        start: Nodes,
        time_s: float,
        /,
        *,
        physics: WorldPhysics | None = None,
        intrusion: Intrusion | None = None,
    ) -> World:
        """The world with the object at its start and the tool at home, from a start time [s].

        `physics`: the kind's own where none is given; `intrusion`: effects that are hidden in it.
        """
        ...


def _away(stage: Stage, start: Nodes) -> ToolPose:
    """Pose over the near edge of the table, pointing down."""
    del stage, start
    return pointing_down(np.array(HOME_TOOL_M))


@final
@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of object; `body`: its class in `app.core.geometry.scene_description`.

    `node_count`: of the worlds that `build` makes; `surfaces`: the object at its nodes as cameras see it; `home`: pose
    of the waiting arm's tool before the first motion.
    """

    body: type
    node_count: Callable[[Stage], int]
    build: Build
    surfaces: Callable[[Stage, Nodes], list[Surface]]
    home: Callable[[Stage, Nodes], ToolPose] = _away
