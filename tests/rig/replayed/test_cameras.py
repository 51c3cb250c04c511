"""Cameras of a recording show what was recorded, dated now, over and over; what cannot be shown is said."""

import time
from collections.abc import Sequence
from pathlib import Path

import anyio
import numpy as np
import pytest

from app.config import Timing
from app.core.errors import DeviceError
from app.core.messages import Frame
from app.recording.read.film import read_film
from app.rig.replayed.camera import ReplayedCamera
from app.rig.replayed.cameras import replayed_cameras
from tests.recording.films import filmed, frames
from tests.recording.samples import Maker

pytestmark = pytest.mark.anyio

TIMING = Timing(camera_timeout_s=2.0)


def recorded(folder: Path, **times_s: Sequence[float]) -> Path:
    make = Maker(seed=5)
    return filmed(folder / "film.mcap", frames(times_s, make), make)


async def until_it_fails(camera: ReplayedCamera) -> None:
    while True:
        await camera.read()


async def test_what_is_shown_was_recorded_and_is_dated_now_over_and_over(tmp_path: Path) -> None:
    path = recorded(tmp_path, left=[0.0, 0.5, 1.0], right=[0.0, 0.5, 1.0])
    film = await anyio.to_thread.run_sync(read_film, path)
    begin_s = time.monotonic()
    async with replayed_cameras(film, TIMING) as screen:
        left, right = screen.cameras
        shown = [await left.read() for _ in range(5)]
        other = await right.read()
    assert [int(frame.depth[0, 0]) for frame in shown] == [1, 2, 3, 1, 2]
    assert all(frame.camera is left.model is film.cameras["left"] for frame in shown)
    assert other.camera is right.model
    assert left.words == right.words == ""
    times = [frame.time_s for frame in shown]
    assert begin_s <= times[0]
    assert times[-1] <= time.monotonic()
    # From frame to frame as it was recorded; a reader that the machine held up lets more time pass.
    assert np.all(np.diff(times) > 0.499)
    assert len({frame.id for frame in shown}) == len(shown)


async def test_a_camera_that_ended_early_ends_the_round_for_all_and_that_is_said(tmp_path: Path) -> None:
    path = recorded(tmp_path, left=[0.0, 0.5, 1.0, 2.0, 3.0, 4.0], right=[0.0, 0.5])
    film = await anyio.to_thread.run_sync(read_film, path)
    async with replayed_cameras(film, TIMING) as screen:
        left, right = screen.cameras
        shown = [await left.read() for _ in range(4)]
    assert [int(frame.depth[0, 0]) for frame in shown] == [1, 2, 1, 2]
    assert "another camera had ended" in left.words
    assert right.words == ""


async def test_a_film_that_is_damaged_in_its_middle_is_said_by_every_camera(tmp_path: Path) -> None:
    path = recorded(tmp_path, left=[0.0, 0.3], right=[0.0, 0.3])
    film = await anyio.to_thread.run_sync(read_film, path)
    whole = await anyio.Path(path).read_bytes()
    # The bytes after the first kilobytes are images; the index at the end stays as it is.
    await anyio.Path(path).write_bytes(whole[:3000] + bytes(2000) + whole[5000:])
    async with replayed_cameras(film, TIMING) as screen:
        for camera in screen.cameras:
            with pytest.raises(DeviceError, match="damaged"):
                await until_it_fails(camera)


async def test_a_camera_that_saw_nothing_for_long_gives_nothing_for_as_long(tmp_path: Path) -> None:
    path = recorded(tmp_path, left=[0.0, 4.0], right=[0.2 * step for step in range(21)])
    film = await anyio.to_thread.run_sync(read_film, path)
    async with replayed_cameras(film, Timing(camera_timeout_s=0.5)) as screen:
        left, right = screen.cameras
        first: Frame = await left.read()
        assert int(first.depth[0, 0]) == 1
        with pytest.raises(DeviceError, match="in the recording either"):
            await left.read()
        assert int((await right.read()).depth[0, 0]) > 1
