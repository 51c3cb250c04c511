"""Beans that a paddle sweeps at random."""

from typing import Any, final

import numpy as np

from app.core.geometry.scene_description import Beans
from app.core.geometry.track import Track
from app.core.types import ToolPose
from app.policy.random_pushes import PushDesign
from app.policy.random_sweeps import random_sweep, sweep_design
from app.rig.simulated.kinds.beans import beans_and_paddle
from app.rig.simulated.testbeds.base import Before, Testbed
from app.rig.simulated.worlds.beans_world import BeansWorld
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.physics import WorldPhysics
from app.rig.simulated.worlds.world import Nodes
from app.tasks.elements.base import Task


@final
class BeanSweeps(Testbed):
    """Sweeps through beans, which are scattered anew in each episode, wherever they were."""

    def body(self, task: Task) -> Beans:
        """The beans."""
        return beans_and_paddle(task.stage)[0]

    def design(self, episodes: int, pushes: int) -> PushDesign:
        """Longer ways than a finger's: a bean that is reached is taken along."""
        return sweep_design(episodes, pushes)

    def lay(
        self,
        task: Task,
        start: Nodes,
        before: Before | None,
        physics: WorldPhysics,
        intrusion: Intrusion,
        time_s: float,
    ) -> BeansWorld:
        """The beans at `start`."""
        del before
        return BeansWorld(*beans_and_paddle(task.stage), start, physics=physics, intrusion=intrusion, time_s=time_s)

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
        """See `random_sweep`."""
        del tool
        beans, paddle = beans_and_paddle(task.stage)
        pieces = nodes.reshape(-1, 2, 3)
        points = np.concatenate([pieces, pieces.mean(1, keepdims=True)], axis=1).reshape(-1, 3).astype(np.float32)
        stroke = random_sweep(rng, points, plan, radius_m=beans.radius_m, half_m=paddle.half_m[:2])
        return stroke.track(start_s=start_s, height_m=paddle.sweep_height_m)

    def describe(self, physics: WorldPhysics, start: Nodes) -> dict[str, Any]:
        """Number of beans, and their resistance to rolling [m]."""
        return {"beans": len(start) // 2, "rolling_m": physics.rolling.rolling_m}


TESTBED = BeanSweeps()
