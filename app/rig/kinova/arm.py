"""A Gen3 in a process of its own, as a rig that has one opens it."""

import os
from collections.abc import AsyncGenerator
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from functools import partial

import anyio
from anyio import to_thread

from app.arm.memory import ArmMemory
from app.arm.process import run_arm
from app.arm.process_arm import ProcessArm
from app.config import Site
from app.core.processes import end, process, ready
from app.rig.kinova.clients import DEFAULT
from app.rig.kinova.configured import DELIVERED, Holds
from app.rig.kinova.control import taken
from app.rig.kinova.link import Address


def kinova_arm(
    address: Address, site: Site, client: str = DEFAULT, holds: Holds = DELIVERED
) -> AbstractAsyncContextManager[ProcessArm]:
    """The arm there, under gate, watchdog and STOP, as long as it is open.

    Raises DeviceError on entry where there is none, or it is not configured for what it `holds`. Left, the arm is at
    rest and the process has ended; where the application is killed the process ends by itself, and where that is killed
    the arm stops by itself.
    """
    return _opened(address, site, client, holds)


@asynccontextmanager
async def _opened(address: Address, site: Site, client: str, holds: Holds) -> AsyncGenerator[ProcessArm]:
    memory = await to_thread.run_sync(ArmMemory)
    take = partial(taken, address, client=client, holds=holds)
    arm = process("arm", run_arm, memory, site, take, os.getpid())
    try:
        await to_thread.run_sync(arm.start)
        await ready([arm], [memory.states])
        yield ProcessArm(memory, arm, site)
    finally:
        with anyio.CancelScope(shield=True):
            memory.closing.value = 1
            await to_thread.run_sync(end, [arm])
