"""A Gen3 behind the port that every arm has: what the application approves is made, and whoever dies, the arm rests."""

import dataclasses
import os
import signal
import time

import anyio
import anyio.to_thread
import numpy as np
import psutil
import pytest

from app.config import Limits, Site, Workspace
from app.core.dialogue.jog import Jog
from app.core.errors import DeviceError, MotionRefused
from app.core.motion import Motion
from app.core.ports import Arm
from app.core.rejection_codes import Refusal
from app.rig.kinova.arm import kinova_arm
from app.rig.kinova.emulator.process import FakeProcess
from tests.rig.kinova.conftest import address, tool, until
from tests.rig.scene import approved

BOX = Workspace(low=(0.3, -0.3, 0.02), high=(0.6, 0.3, 0.45))
SITE = dataclasses.replace(Site(), limits=Limits(speed_m_s=0.25, workspace=BOX))


def push(start: tuple[float, float], end: tuple[float, float], speed_m_s: float = 0.2) -> Motion:
    positions = np.array([[*start, 0.1], [*end, 0.1]])
    return Motion(positions=positions, speeds=np.full(2, speed_m_s))


async def moves(arm: FakeProcess) -> None:
    """Wait until the arm is on its way."""
    await anyio.to_thread.run_sync(until, lambda: np.abs(arm.states.newest()["velocity"]).max() > 0.01)


@pytest.mark.anyio
async def test_an_approved_motion_is_made_and_reported(arm: FakeProcess) -> None:
    async with kinova_arm(address(arm), SITE) as port:
        opened: Arm = port
        before = await opened.state()
        assert before.mode == "idle"
        done = await opened.execute(approved(push((0.45, -0.05), (0.45, 0.05))))
        assert done.outcome == "completed", done.reason
        assert done.measured[-1][:3] == pytest.approx([0.45, 0.05, SITE.travel_height_m], abs=5e-3)
        assert len(done.times_s) > 50
    told = arm.commands()
    assert {each["call"] for each in told} <= {"ExecuteAction", "SendGripperCommand", "Stop"}
    assert all(each["linear_m_s"] <= SITE.limits.speed_m_s * (1 + 1e-6) for each in told)
    positions = np.array([place for each in told for place in each["positions"]])
    assert BOX.contains(positions)


@pytest.mark.anyio
async def test_a_stop_in_the_middle_is_an_outcome_and_holds(arm: FakeProcess) -> None:
    async with kinova_arm(address(arm), SITE) as port, anyio.create_task_group() as tasks:

        async def stop() -> None:
            await moves(arm)
            port.stop()

        tasks.start_soon(stop)
        done = await port.execute(approved(push((0.45, -0.2), (0.45, 0.2), 0.05)))
        assert done.outcome == "stopped"
        assert "STOP" in done.reason
        with pytest.raises(MotionRefused) as refused:
            await port.execute(approved(push((0.45, -0.05), (0.45, 0.05))))
        assert refused.value.code == Refusal.STOPPED
        await port.reset(asked_s=time.monotonic())
        assert (await port.state()).mode == "idle"


@pytest.mark.anyio
async def test_a_way_that_the_arm_itself_would_not_go_is_refused_and_the_next_one_made_without_a_resume(
    arm: FakeProcess,
) -> None:
    far = dataclasses.replace(SITE, limits=dataclasses.replace(SITE.limits, workspace=Workspace(high=(1.0, 0.6, 0.5))))
    async with kinova_arm(address(arm), far) as port:
        with pytest.raises(MotionRefused, match="outside of what the arm reaches") as refused:
            await port.execute(approved(push((0.45, 0.1), (0.9, 0.3))))
        assert refused.value.code == Refusal.UNREACHABLE
        done = await port.execute(approved(push((0.45, -0.05), (0.45, 0.05))))
        assert done.outcome == "completed", done.reason


@pytest.mark.anyio
async def test_a_resume_that_comes_to_nothing_says_why_and_lifts_nothing_later(arm: FakeProcess) -> None:
    async with kinova_arm(address(arm), SITE) as port:
        arm.fail(joint=4, bits=1 << 5, lasting=True)
        await anyio.sleep(0.5)
        with pytest.raises(DeviceError, match="met too much torque") as refused:
            await port.reset(asked_s=time.monotonic())
        assert "still fault" in str(refused.value)
        arm.fail()
        await anyio.sleep(0.5)
        assert (await port.state()).mode == "fault"
        await port.reset(asked_s=time.monotonic())
        assert (await port.state()).mode == "idle"


@pytest.mark.anyio
async def test_a_hand_moves_the_tool_through_the_port(arm: FakeProcess) -> None:
    async with kinova_arm(address(arm), SITE) as port, anyio.create_task_group() as tasks:

        async def hold() -> None:
            for _ in range(30):
                port.jog(Jog(linear=np.array([0.0, 0.1, 0.0])))
                await anyio.sleep(0.02)

        tasks.start_soon(hold)
        moved = await port.accept_jogs()
    assert moved is not None
    assert moved.outcome == "completed"
    assert moved.measured[-1][1] > 0.02


@pytest.mark.anyio
async def test_an_arm_whose_process_is_killed_stops_by_itself(arm: FakeProcess) -> None:
    async with kinova_arm(address(arm), SITE) as port, anyio.create_task_group() as tasks:

        async def kill() -> None:
            await moves(arm)
            (child,) = [each for each in psutil.Process().children() if each.pid != arm.pid and _is_arm(each)]
            os.kill(child.pid, signal.SIGKILL)

        tasks.start_soon(kill)
        with pytest.raises(DeviceError, match="arm's process ended"):
            await port.execute(approved(push((0.45, -0.2), (0.45, 0.2), 0.02)))
    until(lambda: not arm.look()["moving"])
    assert tool(arm)[1] < 0.2


def _is_arm(child: psutil.Process) -> bool:
    """True if `child` is the process that was started last: that of the arm's control."""
    others = [each for each in psutil.Process().children() if "multiprocessing.spawn" in " ".join(each.cmdline())]
    return child.pid == max(others, key=lambda each: each.create_time()).pid


@pytest.mark.anyio
async def test_without_an_arm_it_is_said_on_entry(arm: FakeProcess) -> None:
    nobody = dataclasses.replace(address(arm), tcp_port=1)
    with pytest.raises(DeviceError):
        async with kinova_arm(nobody, SITE):
            pass
