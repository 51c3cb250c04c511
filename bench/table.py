"""A rope in the simulated world without cameras and arm, for the planning and calibration benches."""

from typing import final

import numpy as np

from app.config import Site
from app.core.geometry.shapes.fixtures import Obstacle
from app.core.messages import Executed, Transition, fresh_id
from app.core.motion import Motion, pointing_down
from app.core.types import Points
from app.rig.simulated.worlds.rope_world import RopeWorld
from app.tasks import Task
from app.tasks.elements.curves import fill_tube

NOISE_M = 0.0015
"""Noise of a particle's position on each axis: about that of two cameras and reconstruction."""
_PERIOD_S = 0.01
_SETTLE_S = 1.0


@final
class Table:
    """One episode's rope. Observations are the truth as particles plus noise, new for every look."""

    def __init__(self, task: Task, seed: int, particle_count: int) -> None:
        self._task = task
        self._particle_count = particle_count
        self._rng = np.random.default_rng([seed, 1])
        walls = [fixture for fixture in task.stage.fixtures if isinstance(fixture, Obstacle)]
        self._world = RopeWorld(task.rope, task.finger, task.start(seed), fixtures=walls)

    def observe(self) -> Points:
        """Particles (N, 3) [m] as perception would give them."""
        x = fill_tube(
            self._world.nodes(),
            self._task.rope.radius_m,
            self._particle_count,
            seed=int(self._rng.integers(2**31)),
        )
        noisy = x + NOISE_M * self._rng.standard_normal(x.shape)
        noisy[:, 2] = np.maximum(noisy[:, 2], 0.0)
        return noisy.astype(np.float32)

    def execute(self, motion: Motion) -> Executed:
        """Make the motion exactly, at its speeds, by way of the travel height, and let the rope settle."""
        above = pointing_down(np.array([*motion.positions[0, :2], Site().travel_height_m]))
        self._world.step(above, _PERIOD_S)
        times, measured = [self._world.time_s], [self._world.tool]
        for target, speed in zip(motion.poses, motion.speeds, strict=True):
            begin = self._world.tool
            steps = max(1, round(float(np.linalg.norm((target - begin)[:3])) / speed / _PERIOD_S))
            for step in range(1, steps + 1):
                self._world.step(begin + (target - begin) * step / steps, _PERIOD_S)
                times.append(self._world.time_s)
                measured.append(self._world.tool)
        self._world.step(self._world.tool, _SETTLE_S)
        poses = np.array(measured)[:, :7]
        return Executed(
            id=fresh_id("executed"),
            time_s=self._world.time_s,
            approved_id=fresh_id("approved"),
            outcome="completed",
            reason="",
            times_s=np.array(times),
            commanded=poses,
            measured=poses,
        )

    def push(self, motion: Motion, before: Points) -> Transition:
        """Execute and look again."""
        executed = self.execute(motion)
        after = self.observe()
        return Transition(
            id=fresh_id("transition"), time_s=executed.time_s, before=before, executed=executed, after=after
        )
