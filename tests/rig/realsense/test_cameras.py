"""Whole cameras in processes of their own, with what can go wrong done to them from outside."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import anyio
import numpy as np
import psutil
import pytest
from anyio import to_thread

from app.config import Site, Timing
from app.core.errors import DeviceError
from app.rig.realsense.camera import RealSenseCamera
from app.rig.realsense.camera_mounts import Mounted
from app.rig.realsense.cameras import realsense_cameras
from app.rig.realsense.recovery_policy import RecoveryTimeouts
from app.rig.realsense.sdk.rendered import Feed, Rendered
from app.rig.realsense.sdk.software import CameraDescription
from app.rig.realsense.sdk.sources import Live, RecordedSource
from app.rig.realsense.sdk.synthetic import record
from app.rig.realsense.settings import StreamSettings
from tests.conftest import ROOT
from tests.rig.realsense.bodies import BOX_M, HEIGHT, PLANE_M, RATE_HZ, UNIT_M, WIDTH, Scene, aside, imager, together

TIMING = replace(Site().timing, camera_period_s=0.1, camera_timeout_s=20.0)
SETTINGS = StreamSettings(width=WIDTH, height=HEIGHT, rate_hz=RATE_HZ, warm_up=2)
PATIENCE = RecoveryTimeouts(late_s=0.6, open_s=8.0, quiet_s=1.5, slow_s=10.0, back_off_s=0.2, absent_s=0.2)

pytestmark = pytest.mark.anyio


@dataclass
class Renderer:
    """Renders into `feed` at the camera's rate, in a thread; `fault` is what is wrong with it."""

    body: CameraDescription
    feed: Feed
    fault: str = ""
    shown: int = 0
    sent_s: list[float] = field(default_factory=list)

    def run(self, over: threading.Event) -> None:
        scene, stamp_s = Scene(body=self.body), 0.0
        depth = scene.depth()
        while not over.wait(1 / RATE_HZ):
            if self.fault != "frozen stamps":
                stamp_s = time.monotonic()
            if self.fault == "late":
                stamp_s -= 0.3
            if self.fault != "no images":
                self.feed.images.append(time_s=stamp_s, color=scene.color(self.shown), depth=depth)
                self.shown += 1
                self.sent_s.append(stamp_s)


@asynccontextmanager
async def rendered(body: CameraDescription, timing: Timing = TIMING) -> AsyncIterator[tuple[RealSenseCamera, Renderer]]:
    """A camera that shows what a renderer renders."""
    over, renderer = threading.Event(), Renderer(body=body, feed=await to_thread.run_sync(Feed.of, body))
    thread = threading.Thread(target=renderer.run, args=(over,))
    thread.start()
    mounted = Mounted(name="left", source=Rendered(body=body, feed=renderer.feed), settings=SETTINGS)
    try:
        async with realsense_cameras([mounted], timing, timeouts=PATIENCE) as (camera,):
            yield camera, renderer
    finally:
        over.set()
        thread.join()


@pytest.fixture(scope="module")
def anyio_backend() -> str:
    return "asyncio"


@pytest.fixture(scope="module")
async def opened(anyio_backend: str) -> AsyncIterator[tuple[RealSenseCamera, Renderer]]:
    async with rendered(aside()) as both:
        yield both


def pid(name: str = "left") -> int:
    """Process number of the camera's present process."""
    (process,) = [child for child in multiprocessing.active_children() if child.name == f"dipac camera {name}"]
    assert process.pid is not None
    return process.pid


async def until(true: Callable[[], object]) -> None:
    with anyio.fail_after(20):
        while not true():  # noqa: ASYNC110 - what is waited for is in another process
            await anyio.sleep(0.02)


async def read_on(camera: RealSenseCamera) -> None:
    with anyio.fail_after(30):
        while True:
            await camera.read()


async def test_a_camera_shows_what_is_rendered_for_it(opened) -> None:
    camera, _ = opened
    frame = await camera.read()
    assert frame.camera is camera.model
    assert (frame.camera.name, frame.camera.width, frame.camera.height) == ("left", WIDTH, HEIGHT)
    assert np.allclose(frame.camera.K, aside().color.K, rtol=1e-6)
    assert frame.camera.depth_unit_m == pytest.approx(UNIT_M)
    seen = frame.depth[frame.depth > 0] * UNIT_M
    assert abs(np.median(seen) - PLANE_M) < 0.02
    assert (np.abs(seen - BOX_M) < 0.01).sum() > 500


async def test_a_frame_is_dated_when_it_was_exposed_and_the_next_is_a_period_later(opened) -> None:
    camera, renderer = opened
    frames = [await camera.read() for _ in range(4)]
    times = np.array([frame.time_s for frame in frames])
    assert np.all(np.diff(times) >= TIMING.camera_period_s)
    sent = np.array(renderer.sent_s)
    assert all(np.abs(sent - time_s).min() < 2e-3 for time_s in times)
    assert all(frame.time_s > time.monotonic() - TIMING.camera_timeout_s for frame in frames)
    arrived = camera.arrival
    assert arrived is not None
    assert (arrived.domain, arrived.by) == ("global", "calendar")
    assert arrived.time_s <= arrived.arrival_s
    assert arrived.error_s < 0.01


async def test_a_camera_that_gets_no_images_says_so_and_shows_the_next_ones(opened) -> None:
    camera, renderer = opened
    renderer.fault = "no images"
    await until(lambda: camera.words)
    assert "no image for" in camera.words
    renderer.fault = ""
    assert (await camera.read()).time_s > 0
    await until(lambda: not camera.words)


async def test_stamps_that_stand_still_are_no_images(opened) -> None:
    camera, renderer = opened
    renderer.fault = "frozen stamps"
    await until(lambda: camera.words)
    renderer.fault = ""
    await until(lambda: not camera.words)


async def test_late_images_are_dated_by_when_they_were_taken(opened) -> None:
    camera, renderer = opened
    renderer.fault = "late"
    since_s = time.monotonic() + 0.2
    frame = await camera.read()
    while frame.time_s < since_s:
        frame = await camera.read()
    assert np.abs(np.array(renderer.sent_s) - frame.time_s).min() < 2e-3
    renderer.fault = ""


async def test_a_process_that_is_killed_is_replaced_and_frames_go_on(opened) -> None:
    camera, _ = opened
    before = pid()
    os.kill(before, signal.SIGKILL)
    await until(lambda: "ended with code -9" in camera.words)
    assert (await camera.read()).camera is camera.model
    await until(lambda: not camera.words)
    assert pid() != before


async def test_a_process_that_hangs_is_ended_and_replaced(opened) -> None:
    camera, _ = opened
    before = pid()
    os.kill(before, signal.SIGSTOP)
    await until(lambda: "said nothing" in camera.words)
    await until(lambda: not camera.words)
    assert not psutil.pid_exists(before)
    since_s = time.monotonic()
    assert (await camera.read()).time_s > since_s - 1.0


async def test_a_camera_that_was_unplugged_goes_on_when_it_is_plugged_in_again(opened) -> None:
    camera, renderer = opened
    before = pid()
    renderer.feed.is_plugged = False
    await until(lambda: "is unplugged" in camera.words)
    renderer.feed.is_plugged = True
    since_s = time.monotonic()
    while (await camera.read()).time_s < since_s:
        pass
    await until(lambda: not camera.words)
    assert pid() == before


async def test_no_image_in_the_time_that_the_site_allows_is_an_error_that_says_what_is_done() -> None:
    async with rendered(together(), replace(TIMING, camera_timeout_s=1.5)) as (camera, renderer):
        await camera.read()
        renderer.fault = "no images"
        with pytest.raises(DeviceError, match=r"'left' shows nothing: no image for \d s \("):
            await read_on(camera)


async def test_two_recordings_play_as_two_cameras_and_the_end_of_one_is_said(tmp_path: Path) -> None:
    files = [tmp_path / "left.db3", tmp_path / "right.db3"]
    start_s = time.time() - 1000
    for file in files:
        views = Scene(body=together()).views(20, start_s=start_s)
        await to_thread.run_sync(record, file, together(), views)
    mounted = [
        Mounted(name="left", source=RecordedSource(file=files[0], repeat=True), settings=SETTINGS),
        Mounted(name="right", source=RecordedSource(file=files[1]), settings=SETTINGS),
    ]
    hasty = replace(TIMING, camera_timeout_s=1.5)
    async with realsense_cameras(mounted, hasty, timeouts=PATIENCE) as (left, right):
        with pytest.raises(DeviceError, match="at its end: the recording has been played"):
            await read_on(right)
        times = [(await left.read()).time_s for _ in range(8)]
        assert np.all(np.diff(times) > 0)


async def test_another_camera_in_the_place_of_one_is_not_taken_for_it(tmp_path: Path) -> None:
    file, other = tmp_path / "left.db3", tmp_path / "other.db3"
    start_s = time.time() - 1000
    for path, body in ((file, together()), (other, replace(together(), color=imager(140.0)))):
        await to_thread.run_sync(record, path, body, Scene(body=body).views(15, start_s=start_s))
    mounted = Mounted(name="other", source=RecordedSource(file=file, repeat=True), settings=SETTINGS)
    async with realsense_cameras([mounted], TIMING, timeouts=PATIENCE) as (camera,):
        await camera.read()
        other.replace(file)
        os.kill(pid("other"), signal.SIGKILL)
        with pytest.raises(DeviceError, match="came back with other intrinsics"):
            await read_on(camera)


async def test_a_camera_that_is_not_there_is_named_with_those_that_are() -> None:
    mounted = [Mounted(name="left", source=Live(serial="000000"), settings=SETTINGS)]
    with pytest.raises(DeviceError, match=r"Of camera 'left': no image for .* '000000': there "):
        async with realsense_cameras(mounted, TIMING, timeouts=PATIENCE):
            pass


_OPEN_AND_WAIT = """
import multiprocessing
import sys
from pathlib import Path
import anyio
from app.rig.realsense.cameras import realsense_cameras
from app.rig.realsense.camera_mounts import Mounted
from app.rig.realsense.sdk.sources import RecordedSource
from tests.rig.realsense.test_cameras import SETTINGS, TIMING

async def main(file):
    mounted = [Mounted(name="left", source=RecordedSource(file=Path(file), repeat=True), settings=SETTINGS)]
    async with realsense_cameras(mounted, TIMING):
        print(*[child.pid for child in multiprocessing.active_children()], flush=True)
        await anyio.sleep(60)

if __name__ == "__main__":
    anyio.run(main, sys.argv[1])
"""


async def test_no_process_outlives_an_application_that_is_killed(tmp_path: Path) -> None:
    def killed() -> list[int]:
        record(tmp_path / "left.db3", together(), Scene(body=together()).views(10))
        command = [sys.executable, "-c", _OPEN_AND_WAIT, str(tmp_path / "left.db3")]
        with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as parent:
            assert parent.stdout is not None
            pids = [int(word) for word in parent.stdout.readline().split()]
            parent.kill()
        return pids

    (left,) = await to_thread.run_sync(killed)
    await until(lambda: not psutil.pid_exists(left) or psutil.Process(left).status() == psutil.STATUS_ZOMBIE)
