"""The simulated arm alone: drives that follow their command, without a world."""

from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from functools import partial

from anyio import to_thread

from app.arm.opened import opened_arm
from app.arm.process_arm import ProcessArm
from app.config import Site
from app.core.geometry.scene_description import Stage
from app.rig.simulated.arm_control import ArmControl
from app.rig.simulated.kinds import kind_of
from app.rig.simulated.worlds.world import Nodes


@asynccontextmanager
async def simulated_arm(stage: Stage, start: Nodes, site: Site) -> AsyncGenerator[ProcessArm]:
    """The arm at its home for the stage's object at `start (K, 3)` [m], for as long as it is open."""
    home = await to_thread.run_sync(lambda: kind_of(stage).home(stage, start))
    async with opened_arm(partial(ArmControl, tool=home), site) as arm:
        yield arm
