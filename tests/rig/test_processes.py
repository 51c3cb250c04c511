"""The rig's processes end when they must, whatever happened, and their absence is said in words."""

import dataclasses
import multiprocessing
import os
import signal
import subprocess
import sys
from collections.abc import Awaitable, Callable
from contextlib import AbstractAsyncContextManager

import anyio
import psutil
import pytest

from app.config import Site
from app.core.errors import DeviceError
from app.core.geometry.scene_description import Stage
from app.rig.simulated.rig import SimulatedRig, simulated_rig
from tests.conftest import ROOT
from tests.rig.scene import FINGER, ROPE, approved, push, straight_rope

SITE = dataclasses.replace(Site(), timing=dataclasses.replace(Site().timing, camera_timeout_s=1.5))
NAMES = {"dipac arm", "dipac world", "dipac cameras"}


def opened() -> AbstractAsyncContextManager[SimulatedRig]:
    return simulated_rig(stage=Stage(body=ROPE, tool=FINGER), start=straight_rope(), site=SITE, seed=0)


def process_ids() -> dict[str, int]:
    """The rig's processes by name."""
    return {child.name: child.pid or 0 for child in multiprocessing.active_children() if child.name in NAMES}


def runs(pid: int) -> bool:
    return psutil.pid_exists(pid) and psutil.Process(pid).status() != psutil.STATUS_ZOMBIE


async def again_and_again(ask: Callable[[], Awaitable[object]]) -> None:
    """Ask until it raises; ten seconds are enough for any of the rig's deadlines."""
    with anyio.fail_after(10):
        while True:
            await ask()
            await anyio.sleep(0.02)


@pytest.mark.anyio
async def test_a_process_that_is_gone_is_named_and_leaving_the_rig_ends_the_others() -> None:
    async with opened() as rig:
        pids = process_ids()
        assert set(pids) == NAMES

        os.kill(pids["dipac world"], signal.SIGSTOP)
        with pytest.raises(DeviceError, match="no image"):
            await again_and_again(rig.cameras[0].read)

        os.kill(pids["dipac cameras"], signal.SIGKILL)
        with pytest.raises(DeviceError, match="cameras process ended"):
            await again_and_again(rig.cameras[0].read)

        async with anyio.create_task_group() as tasks:

            async def execute() -> None:
                with pytest.raises(DeviceError, match="arm's process ended"):
                    await rig.arm.execute(approved(push((0.3, -0.2), (0.3, 0.2))))

            tasks.start_soon(execute)
            await anyio.sleep(0.3)
            os.kill(pids["dipac arm"], signal.SIGKILL)
        with pytest.raises(DeviceError, match="open it again"):
            await rig.arm.state()
        rig.arm.stop()
    assert not any(runs(pid) for pid in pids.values())


@pytest.mark.anyio
async def test_an_error_while_the_rig_is_open_ends_all_its_processes() -> None:
    pids: dict[str, int] = {}

    async def fail_with_a_hanging_arm() -> None:
        async with opened() as rig:
            pids.update(process_ids())
            os.kill(pids["dipac arm"], signal.SIGSTOP)
            await again_and_again(rig.arm.state)

    with pytest.raises(DeviceError, match="said nothing"):
        await fail_with_a_hanging_arm()
    assert set(pids) == NAMES
    assert not any(runs(pid) for pid in pids.values())


_OPEN_AND_WAIT = """
import sys
import anyio
import numpy as np
from app.core.dialogue.jog import Jog
from tests.rig.test_processes import opened, process_ids

async def main(jogging):
    async with opened() as rig, anyio.create_task_group() as tasks:
        if jogging:
            tasks.start_soon(rig.arm.accept_jogs)
            while (await rig.arm.state()).mode != "moving":
                rig.arm.jog(Jog(linear=np.array([0.0, 0.1, 0.0])))
                await anyio.sleep(0.03)
        print(*process_ids().values(), flush=True)
        while True:
            rig.arm.jog(Jog(linear=np.array([0.0, 0.1, 0.0])))
            await anyio.sleep(0.03)

if __name__ == "__main__":
    anyio.run(main, sys.argv[1] == "jogging")
"""


@pytest.mark.serial
@pytest.mark.parametrize("doing", ["waiting", "jogging"])
def test_no_process_outlives_an_application_that_is_killed(doing: str) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", _OPEN_AND_WAIT, doing], cwd=ROOT, stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout is not None
        pids = [int(word) for word in parent.stdout.readline().split()]
        parent.kill()
    assert len(pids) == len(NAMES)
    # A process notices within one period of its own; a loaded machine gets a while for that.
    psutil.wait_procs([psutil.Process(pid) for pid in pids if psutil.pid_exists(pid)], timeout=10)
    assert not any(runs(pid) for pid in pids)
