"""The simulated cell in one process, in the time of its clock: with a virtual one it is as fast as it computes.

Arm, world and cameras are those of the rig in processes (`app/rig/simulated/rig.py`); what is missing is that they are
supervised from outside of this process.
"""

from collections.abc import AsyncGenerator, Sequence
from contextlib import asynccontextmanager
from typing import final

import anyio
import numpy as np
from anyio import to_thread

from app.arm.memory import ArmMemory
from app.arm.process import ControlLoop
from app.arm.process_arm import ProcessArm
from app.config import Site
from app.core.errors import first_error
from app.core.geometry.camera import CameraModel
from app.core.geometry.scene_description import Stage
from app.core.messages import Frame, fresh_id
from app.core.ports import Clock
from app.core.system.ring import Ring
from app.rig.simulated.arm_control import ArmControl
from app.rig.simulated.cameras.cameras import table_cameras
from app.rig.simulated.cameras.render import render
from app.rig.simulated.kinds import kind_of
from app.rig.simulated.limbs import known_arm
from app.rig.simulated.world_process import WorldFollower, newest_snapshot, snapshot_ring
from app.rig.simulated.worlds.world import Nodes, Snapshot


@final
class LockStepRig:
    """An arm with the stage's object at `start (K, 3)` [m], and cameras; `seed` is that of their noise."""

    def __init__(self, stage: Stage, start: Nodes, site: Site, seed: int, clock: Clock) -> None:
        kind, memory = kind_of(stage), ArmMemory()
        self.name, self.simulated, self.shape = "lockstep", True, known_arm(stage.tool)
        self._clock, self._period_s = clock, site.timing.arm_period_s
        self._loop = ControlLoop(memory, site, ArmControl(site, kind.home(stage, start)))
        self.arm = self.seen_arm = ProcessArm(memory, _ThisProcess(), site, clock)
        self._snapshots, self._last_s = snapshot_ring(stage), clock.now()
        world = kind.build(stage, start, 0.0)
        world.place(kind.home(stage, start))
        self._follower = WorldFollower(world, memory.states, self._snapshots, self._last_s)
        self.cameras = [
            LockStepCamera(model, stage, self._snapshots, site.timing.camera_period_s, clock, [seed, index])
            for index, model in enumerate(table_cameras())
        ]
        self._tick()

    async def run(self) -> None:
        """Move arm and world on, for ever."""
        while True:
            await self._clock.sleep(self._period_s)
            now_s = self._clock.now()  # Once: a world that is slower than its clock would never be done.
            while self._last_s + self._period_s <= now_s:
                self._tick()

    def _tick(self) -> None:
        """One tick of arm and world: none is left out, so that the arm notices where nobody watches it meanwhile."""
        self._last_s += self._period_s
        self._loop.tick(self._last_s, self._period_s)
        self._follower.follow()


@final
class LockStepCamera:
    """Camera that takes an image of the world when it is read, at most one a period."""

    def __init__(
        self, model: CameraModel, stage: Stage, snapshots: Ring, period_s: float, clock: Clock, seed: Sequence[int]
    ) -> None:
        self._model, self._stage, self._snapshots = model, stage, snapshots
        self._period_s, self._clock, self._rng = period_s, clock, np.random.default_rng(seed)

    @property
    def model(self) -> CameraModel:
        """Its calibration."""
        return self._model

    @property
    def words(self) -> str:
        """Empty: it works."""
        return ""

    async def read(self) -> Frame:
        """An image of the world a period from now."""
        await self._clock.sleep(self._period_s)
        seen = _newest(self._snapshots)
        color, depth = await to_thread.run_sync(lambda: render(seen, self._model, self._rng, stage=self._stage))
        return Frame(id=fresh_id("frame"), time_s=seen.time_s, camera=self._model, color=color, depth=depth)


@asynccontextmanager
async def lockstep_rig(
    *, stage: Stage, start: Nodes, site: Site, seed: int, clock: Clock
) -> AsyncGenerator[LockStepRig]:
    """The rig, for as long as it is open. Errors while it is are raised as they are."""
    rig = await to_thread.run_sync(LockStepRig, stage, start, site, seed, clock)
    try:
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(rig.run)
            yield rig
            tasks.cancel_scope.cancel()
    except BaseExceptionGroup as group:
        raise first_error(group) from group


@final
class _ThisProcess:
    """The process that the arm is ticked in."""

    exitcode = None

    def is_alive(self) -> bool:
        """True: who asks is in it."""
        return True


def _newest(snapshots: Ring) -> Snapshot:
    snapshot = newest_snapshot(snapshots)
    assert snapshot is not None, "a rig that was ticked has reported its world"
    return snapshot
