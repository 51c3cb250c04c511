"""RealSense capture through the SDK without hardware: processor time, delays, and whether waiting lets others run.

`python -m bench.realsense` prints what docs/realsense.md states. Two software cameras of 640x480 pixels show 30 images
a second, which a thread of this process renders once and stamps anew.
"""

import itertools
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import AsyncExitStack
from dataclasses import replace
from typing import final

import anyio
import numpy as np
import psutil
from anyio import to_thread
from rich.console import Console
from rich.table import Table

from app.config import Site
from app.core.geometry.camera import CameraModel
from app.rig.realsense.camera import RealSenseCamera
from app.rig.realsense.camera_mounts import Mounted
from app.rig.realsense.cameras import realsense_cameras
from app.rig.realsense.sdk.rendered import Feed, Rendered
from app.rig.realsense.sdk.sdk import Opening, Sdk
from app.rig.realsense.sdk.software import CameraDescription, SoftwareCamera
from app.rig.realsense.settings import Filters, StreamSettings

_RATE_HZ, _SECONDS = 30, 10.0
_WAIT_S = 1.0
_MODEL = CameraModel(
    name="bench",
    width=640,
    height=480,
    K=np.array([[605.0, 0.0, 319.5], [0.0, 605.0, 239.5], [0.0, 0.0, 1.0]]),
    T_world_camera=np.eye(4),
    depth_unit_m=0.001,
)
_EVERY = Filters(near_m=0.2, far_m=2.0, spatial=True, temporal=True)


def main() -> None:
    """Measure and print."""
    table = Table("what", "measured", box=None, header_style="bold")
    table.add_row("Python beside a waiting try_wait_for_frames, of that beside a sleep", f"{_let_run():.0%}")
    for name, filters in (("no filter", Filters()), ("every filter", _EVERY)):
        for what, value in anyio.run(_captured, filters):
            table.add_row(f"{name}: {what}", value)
    Console().print(table)


def _let_run() -> float:
    """Counting speed of another Python thread while this one waits for images in the SDK, over that while it sleeps."""
    sdk = Sdk.load()
    camera = SoftwareCamera(sdk.rs, CameraDescription.like_d435(_MODEL, "1"))
    opening = Opening.of(sdk)
    opening.pipeline.set_device(camera.device)
    opening.config.enable_stream(sdk.rs.stream.depth, _MODEL.width, _MODEL.height, sdk.rs.format.z16, _RATE_HZ)
    opening.pipeline.start(opening.config)
    asleep = _counted(lambda: time.sleep(_WAIT_S))
    waiting = _counted(lambda: opening.pipeline.try_wait_for_frames(round(_WAIT_S * 1000)))
    opening.pipeline.stop()
    return waiting / asleep


def _counted(meanwhile: Callable[[], object]) -> float:
    """Counts a second by another thread while `meanwhile` runs."""
    over, counts = threading.Event(), itertools.count()

    def count() -> None:
        while not over.is_set():
            next(counts)

    thread = threading.Thread(target=count)
    thread.start()
    started_s = time.monotonic()
    meanwhile()
    lasted_s = time.monotonic() - started_s
    over.set()
    thread.join()
    return next(counts) / lasted_s


@final
class _Renderer:
    """Appends the same images to `feeds` 30 times a second, each stamped when it was appended."""

    def __init__(self, bodies: Sequence[CameraDescription]) -> None:
        self.feeds = [Feed.of(body) for body in bodies]
        rng = np.random.default_rng(0)
        size = (_MODEL.height, _MODEL.width)
        self._color = rng.integers(0, 255, (*size, 3), dtype=np.uint8)
        self._depth = rng.integers(600, 900, size, dtype=np.uint16)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)

    async def __aenter__(self) -> "_Renderer":
        self._thread.start()
        return self

    async def __aexit__(self, *_: object) -> None:
        self._over.set()
        await to_thread.run_sync(self._thread.join)

    def _run(self) -> None:
        due_s = time.monotonic()
        while not self._over.is_set():
            for feed in self.feeds:
                feed.images.append(time_s=time.monotonic(), color=self._color, depth=self._depth)
            due_s += 1 / _RATE_HZ
            time.sleep(max(0.0, due_s - time.monotonic()))


async def _captured(filters: Filters) -> list[tuple[str, str]]:
    """Rows of two cameras that stream for a while and are read as fast as images come."""
    bodies = [CameraDescription.like_d435(_MODEL, serial) for serial in ("1", "2")]
    timing = replace(Site().timing, camera_period_s=0.0)
    settings = StreamSettings(filters=filters)
    async with AsyncExitStack() as stack:
        renderer = await stack.enter_async_context(await to_thread.run_sync(_Renderer, bodies))
        mounted = [
            Mounted(name=body.serial, source=Rendered(body=body, feed=feed), settings=settings)
            for body, feed in zip(bodies, renderer.feeds, strict=True)
        ]
        cameras = await stack.enter_async_context(realsense_cameras(mounted, timing))
        return await _measured(cameras)


async def _measured(cameras: Sequence[RealSenseCamera]) -> list[tuple[str, str]]:
    processes = [each for each in psutil.Process().children() if "spawn_main" in " ".join(each.cmdline())]
    before = [sum(process.cpu_times()[:2]) for process in processes]
    ages, held = list[float](), list[float]()
    started_s = time.monotonic()
    async with anyio.create_task_group() as group:
        for camera in cameras:
            group.start_soon(_read, camera, started_s + _SECONDS, ages, held)
    lasted_s = time.monotonic() - started_s
    used = [sum(process.cpu_times()[:2]) - was for process, was in zip(processes, before, strict=True)]
    return [
        ("images a second and camera", f"{len(ages) / lasted_s / len(cameras):.1f}"),
        ("processor time of a capture process", f"{np.mean(used) / lasted_s:.1%} of a core"),
        ("of that an image", f"{1000 * sum(used) / len(ages):.1f} ms"),
        ("from exposure to the application: median, 99 %, longest", _spread(ages)),
        ("of that after the SDK's pipeline: median, 99 %, longest", _spread(held)),
    ]


async def _read(camera: RealSenseCamera, end_s: float, ages: list[float], held: list[float]) -> None:
    """`ages` of images since they were exposed, `held` since the SDK's pipeline handed them over, to be aligned."""
    while time.monotonic() < end_s:
        frame = await camera.read()
        now_s, arrived = time.monotonic(), camera.arrival
        ages.append(now_s - frame.time_s)
        if arrived is not None and arrived.time_s == frame.time_s:
            held.append(now_s - arrived.arrival_s)


def _spread(durations: Sequence[float]) -> str:
    middle, high, longest = np.percentile(np.array(durations) * 1000, [50, 99, 100])
    return f"{middle:.1f}, {high:.1f}, {longest:.0f} ms"


if __name__ == "__main__":
    main()
