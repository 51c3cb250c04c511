"""A rope that a finger pushes at random."""

from typing import Any, final

import numpy as np
from jaxtyping import Float64

from app.core.geometry.scene_description import Rope
from app.core.geometry.track import Track
from app.core.types import ToolPose
from app.policy.random_pushes import PushDesign, random_track
from app.rig.simulated.testbeds.base import Before, Testbed
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.physics import Centreline, WorldPhysics
from app.rig.simulated.worlds.rope_world import RopeWorld
from app.rig.simulated.worlds.world import Nodes
from app.tasks.elements.base import Task
from app.tasks.elements.curves import fill_tube

_BODY_POINTS = 300


@final
class RopePushes(Testbed):
    """Pushes through points of the rope, which is laid with its ends nearest to where they were."""

    def body(self, task: Task) -> Rope:
        """The rope."""
        return task.rope

    def design(self, episodes: int, pushes: int) -> PushDesign:
        """The usual one."""
        return PushDesign(episodes=episodes, pushes=pushes)

    def lay(
        self,
        task: Task,
        start: Nodes,
        before: Before | None,
        physics: WorldPhysics,
        intrusion: Intrusion,
        time_s: float,
    ) -> RopeWorld:
        """The rope along `start`."""
        line = lay_out(start, None if before is None else before[[0, -1], :2])
        return RopeWorld(task.rope, task.finger, line, physics=physics, intrusion=intrusion, time_s=time_s)

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
        """See `random_track`."""
        del tool
        return random_track(
            rng,
            fill_tube(nodes, task.rope.radius_m, _BODY_POINTS),
            plan,
            start_s=start_s,
            height_m=task.finger.push_height_m,
            core_m=task.finger.half_m,
        )

    def describe(self, physics: WorldPhysics, start: Nodes) -> dict[str, Any]:
        """Stiffness of the rope, by its model, and the place of its end s = -1 [m]."""
        x, y = start[0, :2].tolist()
        if physics.cable is None:
            return {"bend_stiffness_n_m_rad": physics.rope.bend_stiffness_n_m_rad, "first_end_m": [x, y]}
        return {"rigidity_n_m2": physics.cable.rigidity_n_m2, "first_end_m": [x, y]}


def lay_out(start: Centreline, ends: Float64[np.ndarray, "2 2"] | None) -> Centreline:
    """The rope laid along `start`, in the direction that leaves its ends (x, y) [m] nearer to where they were."""
    if ends is None:
        return start
    there, turned = (np.linalg.norm(start[order, :2] - ends) for order in ([0, -1], [-1, 0]))
    return start if there <= turned else start[::-1].copy()


TESTBED = RopePushes()
