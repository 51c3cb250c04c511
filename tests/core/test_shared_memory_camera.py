"""Frames of what is in shared memory: the newest, each once, when it is due, and never an old one."""

import time

import anyio
import numpy as np
import pytest
from anyio import to_thread

from app.core.errors import DeviceError
from app.core.geometry.camera import CameraModel
from app.core.shared_memory_camera import SharedMemoryCamera, image_ring
from app.core.system.ring import Ring

MODEL = CameraModel(name="left", width=4, height=3, K=np.eye(3), T_world_camera=np.eye(4), depth_unit_m=0.001)

pytestmark = pytest.mark.anyio


@pytest.fixture
async def images() -> Ring:
    return await to_thread.run_sync(lambda: image_ring(4, 3, kept=3))


def put(images: Ring, time_s: float, number: int = 1) -> None:
    images.append(time_s=time_s, color=np.full((3, 4, 3), number), depth=np.full((3, 4), number))


def well() -> None:
    """Nothing is wrong."""


async def test_the_newest_image_is_read_once(images: Ring) -> None:
    view, now_s = SharedMemoryCamera(MODEL, images, timeout_s=0.05), time.monotonic()
    for number in (1, 2):
        put(images, now_s + number / 1000, number)
    frame = await view.read(well)
    assert frame is not None
    assert (frame.time_s, int(frame.depth[0, 0]), frame.camera) == (now_s + 2 / 1000, 2, MODEL)
    assert await view.read(well) is None


async def test_an_image_is_waited_for(images: Ring) -> None:
    view, now_s = SharedMemoryCamera(MODEL, images, timeout_s=10.0), time.monotonic()
    async with anyio.create_task_group() as group:

        async def later() -> None:
            await anyio.sleep(0.05)
            put(images, now_s)

        group.start_soon(later)
        frame = await view.read(well)
    assert frame is not None


async def test_time_in_which_the_program_stood_still_is_not_waited(images: Ring, monkeypatch) -> None:
    standstill_s = 0.0
    monotonic = time.monotonic
    monkeypatch.setattr("app.core.system.clock.time.monotonic", lambda: monotonic() + standstill_s)
    view = SharedMemoryCamera(MODEL, images, timeout_s=1.0)
    async with anyio.create_task_group() as group:

        async def sleep_and_wake() -> None:
            nonlocal standstill_s
            await anyio.sleep(0.05)
            standstill_s = 20.0
            await anyio.sleep(0.1)
            put(images, monotonic())

        group.start_soon(sleep_and_wake)
        assert await view.read(well) is not None
    assert await view.read(well) is None


async def test_an_image_that_comes_before_it_is_due_is_not_read(images: Ring) -> None:
    view, now_s = SharedMemoryCamera(MODEL, images, timeout_s=0.05, period_s=0.5), time.monotonic()
    put(images, now_s)
    assert await view.read(well) is not None
    put(images, now_s + 0.4)
    assert await view.read(well) is None
    put(images, now_s + 0.6)
    assert await view.read(well) is not None


async def test_an_old_image_is_none(images: Ring) -> None:
    view = SharedMemoryCamera(MODEL, images, timeout_s=0.05, oldest_s=5.0)
    put(images, time.monotonic() - 6.0)
    assert await view.read(well) is None
    put(images, time.monotonic() - 1.0)
    assert await view.read(well) is not None


async def test_what_is_wrong_ends_the_wait(images: Ring) -> None:
    def gone() -> None:
        raise DeviceError("its process ended")

    with pytest.raises(DeviceError, match="its process ended"):
        await SharedMemoryCamera(MODEL, images, timeout_s=10.0).read(gone)
