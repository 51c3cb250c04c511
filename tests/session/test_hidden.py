"""Occlusion while the application looks: what is hidden is kept, marked as predicted, and given up with a notice."""

from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import replace

import anyio
import numpy as np
import pytest

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.summary import Summary
from app.core.geometry.arm_geometry import ArmShape
from app.core.geometry.camera import CameraModel
from app.core.messages import Frame, Particles, fresh_id
from app.perception.reconstruct import Reconstruction
from app.rig.simulated.limbs import known_arm
from app.session.perception_stage import Sensing, lost_part_notice
from app.tasks.rope_push import TASK
from tests.perception.hiding import screened
from tests.session.cell import MemoryLog, Watcher
from tests.session.rig import TickedArm, photographs, small_cameras
from tests.session.virtual import InsideWorker, VirtualClock

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]

PATIENCE_S, PERIOD_S = 60.0, 0.15
MIDDLE = np.stack([np.full(9, 0.54), np.linspace(-0.04, 0.04, 9), np.full(9, 0.016)], axis=1)


class Screen:
    """Screen that is held in front of the cameras, or is not."""

    def __init__(self) -> None:
        self.held = False


class ScreenedCamera:
    """Camera with photographs of the rope, some of them with a screen in front of its middle."""

    def __init__(self, model: CameraModel, screen: Screen) -> None:
        self._model, self._screen = model, screen

    @property
    def model(self) -> CameraModel:
        return self._model

    async def read(self) -> Frame:
        await anyio.sleep(PERIOD_S)
        color, depth = photographs()["here", self._model.name][0]
        frame = Frame(id=fresh_id("frame"), time_s=anyio.current_time(), camera=self._model, color=color, depth=depth)
        return screened([frame], MIDDLE)[0] if self._screen.held else frame


class ScreenedRig:
    """Rig of these cameras, and an arm at its home."""

    def __init__(self, screen: Screen) -> None:
        self._cameras = [ScreenedCamera(model, screen) for model in small_cameras()]
        self._arm = TickedArm(Site())

    @property
    def name(self) -> str:
        return "screened"

    @property
    def simulated(self) -> bool:
        return True

    @property
    def shape(self) -> ArmShape:
        return known_arm(TASK.stage.tool)

    @property
    def seen_arm(self) -> TickedArm:
        return self._arm

    @property
    def cameras(self) -> Sequence[ScreenedCamera]:
        return self._cameras

    @property
    def arm(self) -> TickedArm:
        return self._arm


@asynccontextmanager
async def looking(how: Reconstruction) -> AsyncIterator[tuple[Sensing, Screen, Watcher]]:
    """Run perception until the block ends."""
    photographs()
    screen, watcher, clock, summary = Screen(), Watcher(), VirtualClock(), Summary()
    announcer = MessageBus(operator=watcher, recorder=MemoryLog(), clock=clock, summary=summary)
    sensing = Sensing(ScreenedRig(screen), how, summary, announcer, clock, InsideWorker)
    with anyio.fail_after(PATIENCE_S):
        async with announcer.recording(), sensing.perceiver, anyio.create_task_group() as tasks:
            tasks.start_soon(sensing.run)
            yield sensing, screen, watcher
            tasks.cancel_scope.cancel()


async def seen_with(sensing: Sensing, *, predicted: bool) -> Particles:
    """The next particles of which some are predicted, or none."""
    async for particles in sensing.particles.changes():
        if particles.predicted.any() == predicted:
            return particles
    raise AssertionError("The channel of particles is never closed.")


@pytest.fixture(scope="module", autouse=True)
def pictures() -> None:
    photographs()


async def test_what_is_hidden_for_a_while_stays_where_it_was_and_is_marked():
    async with looking(TASK.perception) as (sensing, screen, watcher):
        whole = await seen_with(sensing, predicted=False)
        screen.held = True
        hidden = await seen_with(sensing, predicted=True)
        screen.held = False
        again = await seen_with(sensing, predicted=False)
    assert len(hidden.predicted) == len(hidden.positions) == len(whole.positions)
    assert 0.1 < hidden.predicted.mean() < 0.7
    assert np.abs(hidden.unseen[:, 1]).max() < 0.12
    for particles in (whole, hidden, again):
        assert np.ptp(particles.positions[:, 1]) == pytest.approx(0.4, abs=0.03)
        assert np.diff(np.sort(particles.positions[:, 1])).max() < 0.02
    assert not watcher.notices()


async def test_what_is_hidden_for_too_long_is_given_up_and_said_once():
    how = replace(TASK.perception, hidden_s=1.0)
    async with looking(how) as (sensing, screen, watcher):
        await seen_with(sensing, predicted=False)
        screen.held = True
        await seen_with(sensing, predicted=True)
        given_up = await seen_with(sensing, predicted=False)
        for _ in range(3):
            await seen_with(sensing, predicted=False)
    assert np.diff(np.sort(given_up.positions[:, 1])).max() > 0.03
    assert watcher.notices() == [lost_part_notice(how)]
    assert "for 1 s" in lost_part_notice(how)
