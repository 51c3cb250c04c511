"""The simulated cell with an arm that is controlled as a real one is: over the Kortex protocol, on loopback."""

from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from functools import partial

from anyio import to_thread

from app.arm.process import Controlled
from app.rig.kinova.control import taken
from app.rig.kinova.fake.process import FakeProcess
from app.rig.kinova.gen3 import Joints
from app.rig.kinova.link import Address
from app.rig.kinova.seen import Seen
from app.rig.simulated.arm_model import solve_joints


@asynccontextmanager
async def wired_arm() -> AsyncGenerator[Controlled]:
    """How the arm's process takes hold of a simulated Gen3, which answers for as long as this is open.

    Raises DeviceError on entry where it does not start.
    """
    fake = await to_thread.run_sync(FakeProcess)
    await to_thread.run_sync(fake.__enter__)
    try:
        address = Address(host=fake.host, tcp_port=fake.ports[0], udp_port=fake.ports[1])
        yield partial(taken, address, joints_of=drawn)
    finally:
        await to_thread.run_sync(partial(fake.__exit__, None, None, None))


def drawn(seen: Seen) -> Joints:
    """The joints of the arm that the cell draws, with its tool where this one's is: a Gen3's links are shorter."""
    return solve_joints(seen.tool)
