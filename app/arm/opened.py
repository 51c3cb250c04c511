"""An arm of any kind in a process of its own, for as long as it is open."""

import os
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager

import anyio
from anyio import to_thread

from app.arm.memory import ArmMemory
from app.arm.process import Controlled, run_arm
from app.arm.process_arm import ProcessArm
from app.config import Site
from app.core.system.processes import end, process, ready


@asynccontextmanager
async def opened_arm(take: Controlled, site: Site) -> AsyncGenerator[ProcessArm]:
    """The arm that `take` connects to, under gate, watchdog and STOP.

    Raises DeviceError on entry where there is none. On leaving, the arm is at rest and the process has ended; it ends
    by itself where the application is killed.
    """
    memory = await to_thread.run_sync(ArmMemory)
    arm = process("arm", run_arm, memory, site, take, os.getpid())
    try:
        await to_thread.run_sync(arm.start)
        await ready([arm], [memory.states])
        yield ProcessArm(memory, arm, site)
    finally:
        with anyio.CancelScope(shield=True):
            memory.closing.value = 1
            await to_thread.run_sync(end, [arm])
