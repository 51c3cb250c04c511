"""The recorder: before an episode, while it runs, and however it ends."""

import shutil
import subprocess
import sys
from collections.abc import Collection
from pathlib import Path

import anyio
import anyio.lowlevel
import pytest
from anyio import to_thread

from app.core.errors import PreflightError, RecordingError
from app.core.messages import Episode, Frame, Message, Notice
from app.recording.format.channels import TOPICS
from app.recording.library.recover import recover
from app.recording.read.reader import read_messages
from app.recording.write.preflight import Room
from app.recording.write.writer import EpisodeRecorder, open_recording
from tests.recording.samples import Maker

pytestmark = pytest.mark.anyio


async def read(path: Path, kinds: Collection[type[Message]] = tuple(TOPICS)) -> list[Message]:
    return await to_thread.run_sync(lambda: list(read_messages(path, kinds)))


def files_in(folder: Path) -> list[Path]:
    return list(folder.glob("*.mcap"))


def only_file(folder: Path) -> Path:
    (path,) = files_in(folder)
    return path


async def test_the_file_is_named_by_date_task_and_seed(make: Maker, tmp_path: Path) -> None:
    episode = make(Episode, task="rope_push", seed=12)
    async with open_recording(tmp_path / "new" / "folder", episode, Room()) as recorder:
        pass
    date, task, seed = recorder.path.stem.split("-")
    assert (task, seed) == ("rope_push", "seed12")
    assert (len(date), date[8], date[-1]) == (16, "T", "Z")
    assert recorder.path.parent == tmp_path / "new" / "folder"


async def test_two_episodes_within_a_second_have_files_of_their_own(make: Maker, tmp_path: Path) -> None:
    episode = make(Episode)
    async with open_recording(tmp_path, episode, Room()) as first:
        async with open_recording(tmp_path, episode, Room()) as second:
            await second.write(make(Notice))
        await first.write(make(Notice))
    assert first.path != second.path
    for path in (first.path, second.path):
        assert len(await read(path)) == 2


async def test_a_task_name_cannot_leave_the_folder(make: Maker, tmp_path: Path) -> None:
    async with open_recording(tmp_path, make(Episode, task="../../a b"), Room()) as recorder:
        pass
    assert recorder.path.parent == tmp_path


async def test_writers_wait_while_the_queue_is_full_and_nothing_is_lost(make: Maker, tmp_path: Path) -> None:
    frame = make(Frame)
    notices = [make(Notice) for _ in range(150)]
    turns = 0

    async def others() -> None:
        nonlocal turns
        while True:
            turns += 1
            await anyio.lowlevel.checkpoint()

    async with (
        open_recording(tmp_path, make(Episode), Room()) as recorder,
        anyio.create_task_group() as group,
    ):
        group.start_soon(others)
        for notice in notices:
            await recorder.write(frame)
            await recorder.write(notice)
        group.cancel_scope.cancel()
    # 64 wait at most; while the writer works on one of them, 63 are in the queue.
    assert recorder.peak in (63, 64)
    assert turns > 0
    kept = await read(recorder.path, [Notice])
    assert [message.id for message in kept] == [notice.id for notice in notices]
    assert recorder.written == 1 + 2 * len(notices)


async def test_many_tasks_may_write_at_once(make: Maker, tmp_path: Path) -> None:
    frames = [make(Frame) for _ in range(3)]
    notices = [[make(Notice) for _ in range(40)] for _ in frames]

    async with open_recording(tmp_path, make(Episode), Room()) as recorder:

        async def stage(index: int) -> None:
            for notice in notices[index]:
                await recorder.write(frames[index])
                await recorder.write(notice)

        async with anyio.create_task_group() as group:
            for index in range(len(frames)):
                group.start_soon(stage, index)
    kept = [message.id for message in await read(recorder.path, [Notice])]
    for of_stage in notices:
        ids = [notice.id for notice in of_stage]
        assert [i for i in kept if i in set(ids)] == ids


async def test_an_error_in_the_episode_comes_through_and_the_file_is_whole(make: Maker, tmp_path: Path) -> None:
    async def fail() -> None:
        async with open_recording(tmp_path, make(Episode), Room()) as recorder:
            await recorder.write(make(Notice))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        await fail()
    assert len(await read(only_file(tmp_path))) == 2


async def test_an_episode_that_fails_before_anything_was_said_leaves_no_file(make: Maker, tmp_path: Path) -> None:
    with pytest.raises(PreflightError, match="no arm"):
        async with open_recording(tmp_path, make(Episode), Room()):
            raise PreflightError("There is no arm.")
    assert files_in(tmp_path) == []
    async with open_recording(tmp_path, make(Episode), Room()) as recorder:
        pass
    assert only_file(tmp_path) == recorder.path


async def test_a_cancelled_episode_leaves_a_whole_file(make: Maker, tmp_path: Path) -> None:
    with anyio.CancelScope() as scope:
        async with open_recording(tmp_path, make(Episode), Room()) as recorder:
            for _ in range(20):
                await recorder.write(make(Frame))
            scope.cancel()
            await anyio.sleep(60)
    assert len(await read(recorder.path)) == 21


async def test_a_message_without_a_channel_is_refused_by_name(make: Maker, tmp_path: Path) -> None:
    async with open_recording(tmp_path, make(Episode), Room()) as recorder:
        with pytest.raises(RecordingError, match="Message have no channel"):
            await recorder.write(Message(id=make(Notice).id, time_s=1.0))


async def test_what_cannot_be_encoded_is_told_and_costs_nothing_else(make: Maker, tmp_path: Path) -> None:
    async def write_nonsense() -> None:
        async with open_recording(tmp_path, make(Episode), Room()) as recorder:
            await recorder.write(make(Notice))
            await recorder.write(make(Notice, time_s=float("nan")))

    with pytest.raises(RecordingError, match=r"is incomplete: .*NaN"):
        await write_nonsense()
    assert [type(message) for message in await read(only_file(tmp_path))] == [Episode, Notice]


async def test_what_failed_is_told_though_the_folder_is_gone(make: Maker, tmp_path: Path) -> None:
    folder = tmp_path / "recordings"

    async def write_nonsense() -> None:
        async with open_recording(folder, make(Episode), Room()) as recorder:
            await to_thread.run_sync(shutil.rmtree, folder)
            await recorder.write(make(Notice, time_s=float("nan")))

    with pytest.raises(RecordingError, match=r"is incomplete: .*NaN"):
        await write_nonsense()


async def test_a_file_that_is_gone_at_the_end_is_told(make: Maker, tmp_path: Path) -> None:
    folder = tmp_path / "recordings"

    async def lose_the_file() -> None:
        async with open_recording(folder, make(Episode), Room()):
            await to_thread.run_sync(shutil.rmtree, folder)

    with pytest.raises(RecordingError, match=r"is incomplete: .*No such file"):
        await lose_the_file()


async def test_those_who_wait_while_a_write_fails_are_told(make: Maker, tmp_path: Path) -> None:
    frame, nonsense = make(Frame), make(Notice, time_s=float("nan"))
    outcomes: list[str] = []

    async def write(recorder: EpisodeRecorder, message: Message) -> None:
        try:
            await recorder.write(message)
            outcomes.append("written")
        except RecordingError:
            outcomes.append("told")

    async def write_at_once() -> None:
        async with (
            open_recording(tmp_path, make(Episode), Room()) as recorder,
            anyio.create_task_group() as group,
        ):
            for message in (*[frame] * 20, nonsense, *[frame] * 180):
                group.start_soon(write, recorder, message)

    with pytest.raises(RecordingError, match="is incomplete"):
        await write_at_once()
    assert len(outcomes) == 201
    # As many as the queue holds came before the failure, or while it was being written.
    assert outcomes.count("told") > 100


async def test_a_file_in_place_of_the_folder_is_told(make: Maker, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(PreflightError, match="recordings folder"):
            async with open_recording(folder, make(Episode), Room()):
                pytest.fail("an episode started")


async def test_a_folder_that_nobody_can_write_to_is_told(make: Maker) -> None:
    with pytest.raises(PreflightError, match=r"Cannot write to /proc/recordings .*choose another") as caught:
        async with open_recording(Path("/proc/recordings"), make(Episode), Room()):
            pytest.fail("an episode started")
    assert "\n" not in str(caught.value)


async def test_too_little_free_disk_is_told_before_a_file_is_made(make: Maker, tmp_path: Path) -> None:
    with pytest.raises(PreflightError, match=r"GB are free in .*delete old recordings"):
        async with open_recording(tmp_path, make(Episode), Room(min_free_bytes=1 << 60)):
            pytest.fail("an episode started")
    assert files_in(tmp_path) == []


_FULL_DISK = """
import resource, signal, sys
from pathlib import Path
import anyio
from app.core.errors import RecordingError
from app.core.messages import Episode, Frame
from app.recording.write.preflight import Room
from app.recording.write.writer import open_recording
from tests.recording.samples import Maker

async def main():
    make = Maker(seed=3)
    async with open_recording(Path(sys.argv[1]), make(Episode), Room()) as recorder:
        for count in range(1000):
            await recorder.write(make(Frame))

# The kernel refuses every byte beyond the limit, as a full disk does.
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (5_000_000, 5_000_000))
try:
    anyio.run(main)
except RecordingError as error:
    print(error)
"""


@pytest.mark.serial
def test_a_disk_that_fills_up_stops_the_episode_and_keeps_what_fitted(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", _FULL_DISK, str(tmp_path)], capture_output=True, text=True, timeout=120, check=True
    )
    assert "is incomplete" in done.stdout
    (path,) = tmp_path.glob("*.mcap")
    recovered = recover(path)
    kept = list(read_messages(recovered.path))
    assert isinstance(kept[0], Episode)
    assert sum(isinstance(message, Frame) for message in kept) >= 3
