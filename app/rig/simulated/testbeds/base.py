"""Interface of a task's random motions in a world with hidden effects."""

from typing import Any, Protocol, TypeAlias

import numpy as np
from jaxtyping import Float64

from app.core.geometry.scene_description import Body
from app.core.geometry.track import Track
from app.core.types import ToolPose
from app.policy.random_pushes import PushDesign, midway_s
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.physics import WorldPhysics
from app.rig.simulated.worlds.world import Nodes, World
from app.tasks.elements.base import Task

Before: TypeAlias = Float64[np.ndarray, "L 3"]
"""Nodes [m] of an object that was there, as many as its world had."""


class Testbed(Protocol):
    """A task's object as it is laid, moved at random, and told of in the sealed truth.

    `holds`: the object stays in the tool from the first motion of an episode to its end; `in_hand`: it is laid there.
    """

    holds: bool = False
    in_hand: bool = False

    def body(self, task: Task) -> Body:
        """The object."""
        ...

    def design(self, episodes: int, pushes: int) -> PushDesign:
        """Design of an experiment with so many random motions of its tool."""
        ...

    def lay(
        self,
        task: Task,
        start: Nodes,
        before: Before | None,
        physics: WorldPhysics,
        intrusion: Intrusion,
        time_s: float,
    ) -> World:
        """A world with the object at `start`; `before`: the one that was there, None at first."""
        ...

    def draw_track(
        self,
        task: Task,
        rng: np.random.Generator,
        nodes: Nodes,
        plan: PushDesign,
        *,
        start_s: float,
        tool: ToolPose | None = None,
    ) -> Track:
        """A random motion of the tool through the object at its nodes.

        `tool`: where it holds the object, at the end of the last command or as that was laid; None of a tool that holds
        nothing.
        """
        ...

    def midway_s(self, command: Track) -> float:
        """A moment of a motion at which cameras look at it: in its later half, where nothing else is said."""
        return midway_s(command.times_s)

    def describe(self, physics: WorldPhysics, start: Nodes) -> dict[str, Any]:
        """Truth of the object in this world, beside friction, and of the place where it was laid first."""
        ...
