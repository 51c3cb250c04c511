"""RealSense cameras of a rig: opened together, supervised, closed together."""

from collections.abc import AsyncGenerator, Sequence
from contextlib import AbstractAsyncContextManager, asynccontextmanager

import anyio
from anyio import to_thread

from app.config import Timing
from app.core.errors import DeviceError, first_error
from app.core.shared_memory_camera import SharedMemoryCamera
from app.rig.realsense.camera import RealSenseCamera
from app.rig.realsense.camera_mounts import Mounted
from app.rig.realsense.camera_supervisor import Keeper
from app.rig.realsense.recovery_policy import RecoveryTimeouts

_START_S = 30.0


def realsense_cameras(
    mounted: Sequence[Mounted], timing: Timing, *, timeouts: RecoveryTimeouts | None = None, start_s: float = _START_S
) -> AbstractAsyncContextManager[Sequence[RealSenseCamera]]:
    """The cameras, each streaming in a supervised process of its own until the block is left.

    Raises DeviceError on entry, with the problem, where one is missing, gives no image within `start_s`, or differs
    from its calibration.
    """
    return _open_cameras(mounted, timing, timeouts or RecoveryTimeouts(), start_s)


@asynccontextmanager
async def _open_cameras(
    mounted: Sequence[Mounted], timing: Timing, timeouts: RecoveryTimeouts, start_s: float
) -> AsyncGenerator[Sequence[RealSenseCamera]]:
    keepers = [
        await to_thread.run_sync(Keeper, each.name, each.source, each.settings, timeouts)  # Makes memory, which blocks.
        for each in mounted
    ]
    try:
        async with anyio.create_task_group() as keeping:
            for keeper in keepers:
                keeping.start_soon(keeper.run)
            try:
                await _streaming(mounted, keepers, start_s)
                yield [_camera(each, keeper, timing) for each, keeper in zip(mounted, keepers, strict=True)]
            finally:
                keeping.cancel_scope.cancel()
    except BaseExceptionGroup as errors:
        raise first_error(errors) from errors


async def _streaming(mounted: Sequence[Mounted], keepers: Sequence[Keeper], start_s: float) -> None:
    """Wait until every camera has given an image. Raises DeviceError where one will not, or is missing."""
    with anyio.move_on_after(start_s):
        for keeper in keepers:
            await keeper.known.wait()
    silent = [
        f"camera {each.name!r}: {keeper.words}"
        for each, keeper in zip(mounted, keepers, strict=True)
        if not keeper.has_streamed
    ]
    if silent:
        raise DeviceError(f"Of {'; of '.join(silent)}. `dipac doctor` looks for cameras.")


def _camera(mounted: Mounted, keeper: Keeper, timing: Timing) -> RealSenseCamera:
    identity = keeper.memory.identity
    assert identity is not None, "a camera that streams has said which it is"
    model, timeout_s = mounted.model(identity), timing.camera_timeout_s
    view = SharedMemoryCamera(
        model, keeper.memory.images, timeout_s=timeout_s, oldest_s=timeout_s, period_s=timing.camera_period_s
    )
    return RealSenseCamera(view, keeper)
