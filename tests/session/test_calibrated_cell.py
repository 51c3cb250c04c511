"""The whole way on the simulated cell: a board in its gripper, views at rest, and a camera found where it stands."""

import time
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import anyio
import numpy as np
import pytest

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.camera_calibration_messages import Placing
from app.core.dialogue.jog import Jog
from app.core.dialogue.requests import CalibrationAct, CalibrationRequest
from app.core.dialogue.summary import Summary
from app.core.messages import Frame, Message, Notice, fresh_id
from app.core.ports import Camera
from app.core.system.channel import Latest
from app.recording.exchange.calibration_file import CalibrationFile
from app.rig.simulated.cameras.held_board import HeldBoard
from app.rig.simulated.rig import SimulatedRig, simulated_rig
from app.session.requests.calibrating import Calibrating
from app.tasks.rope_push import TASK
from tests.session.cell import MemoryLog, Watcher
from tests.session.virtual import VirtualClock

pytestmark = [pytest.mark.anyio, pytest.mark.slow]


@pytest.fixture(scope="module")
def anyio_backend() -> str:
    """The backend with real time, since the cell's processes take their own."""
    return "asyncio"


TURNS_RAD = [
    (-0.35, 0.0, 0.0),
    (0.0, 0.35, 0.0),
    (0.0, -0.7, 0.0),
    (-0.3, 0.35, 0.0),
    (0.1, 0.2, 0.3),
    (0.0, 0.0, -0.6),
]
"""Turns of the tool about the world's axes, one after the other."""
STEP_S, JOG_S = 0.03, 1.5


class Session:
    """A person who jogs the arm and takes views of one camera."""

    def __init__(self, rig: SimulatedRig, path: Path) -> None:
        self.rig, self.shown = rig, Watcher()
        self.frames = {camera.model.name: Latest[Frame](camera.model.name) for camera in rig.cameras}
        announcer = MessageBus(operator=self.shown, recorder=MemoryLog(), clock=VirtualClock(), summary=Summary())
        self.stage = Calibrating(rig, self.frames, CalibrationFile(path), Site(), announcer, VirtualClock())

    async def capture(self, camera: Camera) -> None:
        while True:
            self.frames[camera.model.name].put(await camera.read())

    async def asks(self, act: CalibrationAct, camera: str) -> Placing:
        request = CalibrationRequest(
            id=fresh_id("request"), time_s=time.monotonic(), operator="client 0", act=act, camera=camera
        )
        await self.stage.handle(request, "teleoperate")
        said: list[Message] = [message for message in self.shown.seen if isinstance(message, Placing | Notice)]
        assert isinstance(said[-1], Placing), said[-1]
        return said[-1]

    async def jogs(self, *, turn_rad: Sequence[float] = (0.0, 0.0, 0.0), by_m: Sequence[float] = (0, 0, 0)) -> None:
        """Move the tool by about so much, and let it rest."""
        jog = Jog(angular=np.array(turn_rad) / JOG_S, linear=np.array(by_m) / JOG_S)
        async with anyio.create_task_group() as group:
            group.start_soon(self.rig.arm.accept_jogs)
            until_s = time.monotonic() + JOG_S
            while time.monotonic() < until_s:
                self.rig.arm.jog(jog)
                await anyio.sleep(STEP_S)


@asynccontextmanager
async def session(path: Path) -> AsyncIterator[Session]:
    opening = simulated_rig(stage=TASK.stage, start=TASK.start(0), site=Site(), seed=0, held=HeldBoard())
    async with opening as rig, anyio.create_task_group() as stages:
        run = Session(rig, path)
        for camera in rig.cameras:
            stages.start_soon(run.capture, camera)
        stages.start_soon(run.stage.run)
        yield run
        stages.cancel_scope.cancel()


async def test_the_simulated_cameras_are_found_where_they_stand(tmp_path: Path) -> None:
    async with session(tmp_path / "calibration.toml") as run:
        await run.jogs(by_m=(0.08, 0.02, -0.13))
        camera = run.rig.cameras[0].model.name
        await run.asks("begin", camera)
        last = await run.asks("take", camera)
        for turn in TURNS_RAD:
            await run.jogs(turn_rad=turn)
            last = await run.asks("take", camera)
        assert last.placed, last.said
        assert last.placed[0].moved_m < 3e-3
        assert last.placed[0].turned_deg < 0.3
        assert "kept camera" in (await run.asks("save", camera)).said
