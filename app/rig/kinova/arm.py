"""A Gen3 in a process of its own, as rigs open it."""

from contextlib import AbstractAsyncContextManager
from functools import partial

from app.arm.opened import opened_arm
from app.arm.process_arm import ProcessArm
from app.config import Site
from app.rig.kinova.arm_configuration_check import DELIVERED, Holds
from app.rig.kinova.client.clients import DEFAULT
from app.rig.kinova.client.link import Address
from app.rig.kinova.control import connect_arm


def kinova_arm(
    address: Address, site: Site, client: str = DEFAULT, holds: Holds = DELIVERED
) -> AbstractAsyncContextManager[ProcessArm]:
    """The arm at `address`, under gate, watchdog and STOP, for as long as it is open.

    Raises DeviceError on entry where none answers, or it is not configured for what it `holds`. On leaving, the arm is
    at rest and the process has ended; where the application is killed the process ends by itself, and where that is
    killed the arm stops by itself.
    """
    return opened_arm(partial(connect_arm, address, client=client, holds=holds), site)
