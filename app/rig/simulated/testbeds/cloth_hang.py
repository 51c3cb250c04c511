"""A cloth that a gripper takes at its edge, and carries about at random."""

from typing import Any, final

import numpy as np

from app.core.geometry.scene_description import Cloth
from app.core.geometry.track import Track
from app.core.types import ToolPose
from app.policy.random_carries import carry_design, random_carry, random_grasp
from app.policy.random_pushes import PushDesign
from app.rig.simulated.kinds.cloth import cloth_and_gripper
from app.rig.simulated.testbeds.base import Before, Testbed
from app.rig.simulated.worlds.cloth_world import ClothWorld
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.physics import WorldPhysics
from app.rig.simulated.worlds.world import Nodes
from app.tasks.elements.base import Task

_GRASP_M = 0.006
"""Height of the fingers' tips where they take the cloth from the table."""
_CLOSED_M = 0.004


@final
class ClothCarries(Testbed):
    """Carries of a cloth that lies flat at the beginning of each episode, and stays in the gripper until its end."""

    holds = True

    def body(self, task: Task) -> Cloth:
        """The cloth."""
        return cloth_and_gripper(task.stage)[0]

    def design(self, episodes: int, pushes: int) -> PushDesign:
        """See `carry_design`."""
        return carry_design(episodes, pushes)

    def lay(
        self,
        task: Task,
        start: Nodes,
        before: Before | None,
        physics: WorldPhysics,
        intrusion: Intrusion,
        time_s: float,
    ) -> ClothWorld:
        """The cloth at `start`."""
        del before
        cloth, gripper = cloth_and_gripper(task.stage)
        return ClothWorld(
            cloth,
            gripper,
            start,
            fixtures=task.stage.fixtures,
            physics=physics,
            turns=True,
            intrusion=intrusion,
            time_s=time_s,
        )

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
        """A carry from where the last one ended; the first one of an episode takes the cloth at its edge."""
        cloth, gripper = cloth_and_gripper(task.stage)
        if tool is None:
            knots = nodes.reshape(cloth.nodes_a_side, cloth.nodes_a_side, 3)
            edge = np.concatenate([knots[0], knots[-1], knots[1:-1, 0], knots[1:-1, -1]]).astype(np.float32)
            tool = random_grasp(rng, edge, height_m=_GRASP_M, opening_m=gripper.opening_m)
        return random_carry(rng, tool, plan, start_s=start_s, closed_m=_CLOSED_M)

    def describe(self, physics: WorldPhysics, start: Nodes) -> dict[str, Any]:
        """Stiffness of the cloth [N/m], and the rate at which the air slows it [1/s]."""
        del start
        return {"membrane_n_m": physics.cloth.membrane_n_m, "air_drag_1_s": physics.cloth.air_drag_1_s}


TESTBED = ClothCarries()
