"""Demonstrations and clips beside a session's recording: what stands in which file, and what becomes of it."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast

import anyio
import pytest
from anyio import to_thread

from app.__main__ import main
from app.core.dialogue.control import Mode
from app.core.errors import PreflightError, RecordingError, UsageError
from app.core.messages import Episode, Frame, Goal, Message, MessageId, Model, Notice, Transition
from app.core.ports import Recorder
from app.core.ports import Studio as Port
from app.recording.format import digests
from app.recording.format.channels import TOPICS
from app.recording.library.checks import check
from app.recording.library.label import labels
from app.recording.library.recording_index import counted_once, entry
from app.recording.library.recover import recover
from app.recording.library.session_recorder import SessionRecorder, open_studio
from app.recording.read.reader import read_messages, read_transitions
from app.recording.write.preflight import Room
from tests.recording.demonstrations import PARTICLES, PUSHES, messages
from tests.recording.samples import Maker, same_as_read
from tests.recording.test_foxglove import lines, metadata

pytestmark = pytest.mark.anyio


@pytest.fixture
def episode(make: Maker) -> Episode:
    return make(Episode, cause=(), task="rope_push", seed=4, config=json.dumps({"preset": "cpu"}))


@pytest.fixture
def opening(make: Maker) -> list[Message]:
    return [make(Goal, cause=()), make(Model, cause=()), make(Mode, cause=())]


async def read(path: Path, kinds: Collection[type[Message]] = tuple(TOPICS)) -> list[Message]:
    return await to_thread.run_sync(lambda: list(read_messages(path, kinds)))


def ids(said: Sequence[Message]) -> list[MessageId]:
    return [message.id for message in said]


def files_in(folder: Path) -> set[str]:
    return {file.name for file in folder.iterdir()}


async def noted(path: Path) -> str | None:
    return await to_thread.run_sync(digests.stored_digest, path)


def notices(make: Maker, count: int) -> list[Message]:
    return [make(Notice, cause=()) for _ in range(count)]


async def write(studio: SessionRecorder, said: Sequence[Message]) -> None:
    for message in said:
        await studio.write(message)


async def test_it_is_the_recorder_and_the_studio_of_the_flow(tmp_path: Path, episode: Episode) -> None:
    async with open_studio(tmp_path, episode, Room()) as studio:
        recorder: Recorder = studio
        port: Port = studio
        assert recorder is port


async def test_a_demonstration_holds_its_opening_and_exactly_what_was_said_while_it_was_open(
    make: Maker, tmp_path: Path, episode: Episode, opening: list[Message]
) -> None:
    before, within, after = (notices(make, 20) for _ in range(3))
    within[5] = make(Frame, cause=())
    async with open_studio(tmp_path, episode, Room()) as studio:
        await write(studio, before)
        path = await studio.begin(lambda: opening)
        await write(studio, within)
        await studio.end("success", operator="Ada")
        await write(studio, after)
    began, *rest = await read(path)
    assert ids(rest) == ids([*opening, *within])
    assert all(same_as_read(a, b) for a, b in zip([*opening, *within], rest, strict=True))
    assert ids(await read(studio.path)) == ids([episode, *before, *within, *after])
    assert isinstance(began, Episode)
    assert began.id != episode.id
    assert json.loads(began.config) == {"preset": "cpu", "demonstration": 1, "session": studio.path.name}
    assert replace(began, id=episode.id, time_s=episode.time_s, config=episode.config).rig == episode.rig


async def test_a_demonstration_is_read_again_by_its_name_in_the_sessions_folder_and_no_other_file(
    make: Maker, tmp_path: Path, episode: Episode, opening: list[Message]
) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    async with open_studio(folder, episode, Room()) as studio:
        path = await studio.begin(lambda: opening)
        moved = [make(Transition, cause=()) for _ in range(2)]
        await write(studio, moved)
        await studio.end("success", operator="Ada")
        task, transitions = await studio.demonstration(path.name)
        assert task == "rope_push"
        assert ids(transitions) == ids(moved)
        (tmp_path / "other.mcap").write_bytes(path.read_bytes())
        long = f"{300 * 'a'}.mcap"
        for named in ("../other.mcap", str(tmp_path / "other.mcap"), "none.mcap", "", ".", "a\0.mcap", long):
            with pytest.raises(UsageError, match="There is no demonstration"):
                await studio.demonstration(named)


async def test_what_was_on_its_way_as_a_demonstration_began_is_in_it_once(
    tmp_path: Path, episode: Episode, opening: list[Message], make: Maker
) -> None:
    said = notices(make, 2)
    async with open_studio(tmp_path, episode, Room()) as studio:
        # Somebody has said the first already, and its writing waits while the demonstration begins with it.
        path = await studio.begin(lambda: [*opening, said[0]])
        await write(studio, said)
        await studio.end("success", operator="Ada")
    assert ids((await read(path))[1:]) == ids([*opening, *said])
    assert ids((await read(studio.path))[1:]) == ids(said)


async def test_a_demonstration_is_a_recording_like_any_other(
    make: Maker, tmp_path: Path, episode: Episode, capsys: pytest.CaptureFixture[str]
) -> None:
    goal, *said = messages(make, PARTICLES, 2)
    async with open_studio(tmp_path, episode, Room()) as studio:
        await write(studio, [goal])
        path = await studio.begin(lambda: [goal])
        await write(studio, said)
        await studio.end("success", operator="Ada")
    assert path.stem.split("-")[1:] == ["rope_push", "demo1", "seed4"]
    assert await to_thread.run_sync(check, path) == []
    found = await to_thread.run_sync(entry, path)
    assert (found.condition, found.demonstration, found.said, found.pushes) == ("whole", True, "success", PUSHES)
    assert found.session == studio.path.name
    assert len(await to_thread.run_sync(read_transitions, path)) == PUSHES
    export = ["export", "--to", "npz", "-o", f"{tmp_path}/npz"]
    for command in (["list"], ["show"], ["check"], ["label", "failure"], export):
        assert await to_thread.run_sync(main, ["recordings", *command, str(path)]) == 0
    assert (tmp_path / "npz" / f"{path.stem}.npz").is_file()
    assert "Ada" in capsys.readouterr().out


async def test_what_is_named_with_its_session_counts_once(
    tmp_path: Path, episode: Episode, opening: list[Message]
) -> None:
    async with open_studio(tmp_path, episode, Room()) as studio:
        part = await studio.begin(lambda: opening)
        await studio.end("success", operator="Ada")
    assert await to_thread.run_sync(counted_once, [part, studio.path]) == [studio.path]
    assert await to_thread.run_sync(counted_once, [part]) == [part]


async def test_plain_readers_find_the_session_and_the_number_in_it(
    tmp_path: Path, episode: Episode, opening: list[Message]
) -> None:
    async with open_studio(tmp_path, episode, Room()) as studio:
        for number in (1, 2):
            path = await studio.begin(lambda: opening)
            await studio.end("failure", operator="Ada")
            told = await to_thread.run_sync(lambda path=path: main_metadata(path))
            assert json.loads(told["config"])["demonstration"] == number
            assert json.loads(told["config"])["session"] == studio.path.name
    assert await to_thread.run_sync(lambda: len({m.log_time for _, _, m in lines(path)})) == 4
    assert metadata(studio.path)["epoch_offset_ns"] == main_metadata(path)["epoch_offset_ns"]


def main_metadata(path: Path) -> dict[str, str]:
    """The metadata of a file that has labels, too."""
    from mcap.reader import make_reader

    with path.open("rb") as stream:
        return next(dict(record.metadata) for record in make_reader(stream).iter_metadata() if record.name == "dipac")


async def test_a_verdict_is_a_label_with_the_operator_and_the_sum_is_right(
    tmp_path: Path, episode: Episode, opening: list[Message]
) -> None:
    async with open_studio(tmp_path, episode, Room()) as studio:
        path = await studio.begin(lambda: opening)
        await studio.end("failure", operator="Ada")
        (label,) = await to_thread.run_sync(labels, path)
        assert (label.said, label.operator) == ("failure", "Ada")
        assert await noted(path) == await to_thread.run_sync(digests.digest, path)


async def test_what_is_discarded_leaves_neither_file_nor_sum(
    make: Maker, tmp_path: Path, episode: Episode, opening: list[Message]
) -> None:
    said = notices(make, 3)
    async with open_studio(tmp_path, episode, Room()) as studio:
        path = await studio.begin(lambda: opening)
        await write(studio, said)
        await studio.end(None, operator="Ada")
        assert not await anyio.Path(path).exists()
        again = await studio.begin(lambda: opening)
        await studio.end("success", operator="Ada")
    assert await noted(path) is None
    assert files_in(tmp_path) == {studio.path.name, again.name, digests.SUMS}
    assert ids(await read(studio.path)) == ids([episode, *said])


async def test_a_session_that_ends_closes_a_demonstration_and_says_nothing_of_it(
    make: Maker, tmp_path: Path, episode: Episode, opening: list[Message]
) -> None:
    said = notices(make, 3)
    with anyio.CancelScope() as scope:
        async with open_studio(tmp_path, episode, Room()) as studio:
            path = await studio.begin(lambda: opening)
            await write(studio, said)
            scope.cancel()
            await anyio.sleep(60)
    assert ids(await read(path))[1:] == ids([*opening, *said])
    assert await to_thread.run_sync(labels, path) == []
    assert await to_thread.run_sync(check, path) == []


async def test_what_cannot_be_done_is_refused_in_words(
    tmp_path: Path, episode: Episode, opening: list[Message]
) -> None:
    async with open_studio(tmp_path, episode, Room()) as studio:
        with pytest.raises(RecordingError, match="begin one first"):
            await studio.end("success", operator="Ada")
        await studio.begin(lambda: opening)
        with pytest.raises(RecordingError, match=r"demo1-seed4.mcap is still being recorded; end"):
            await studio.begin(lambda: opening)
        for nonsense in (0.0, -1.0, float("nan"), float("inf")):
            with pytest.raises(RecordingError, match="ask for a number of seconds"):
                await studio.clip(nonsense)


async def test_a_disk_without_room_is_told_before_a_demonstration_begins(
    make: Maker, tmp_path: Path, episode: Episode, opening: list[Message]
) -> None:
    async with open_studio(tmp_path, episode, Room(), take_bytes=1 << 60) as studio:
        with pytest.raises(PreflightError, match="GB are free"):
            await studio.begin(lambda: opening)
        await write(studio, notices(make, 2))
    assert files_in(tmp_path) == {studio.path.name, digests.SUMS}


async def test_what_the_session_is_expected_to_take_is_not_for_demonstrations(
    tmp_path: Path, episode: Episode, opening: list[Message]
) -> None:
    room = Room(expected_bytes=10_000_000, budget_bytes=11_000_000)
    async with open_studio(tmp_path, episode, room, take_bytes=3_000_000) as studio:
        with pytest.raises(PreflightError, match="--budget-gb"):
            await studio.begin(lambda: opening)


async def test_a_demonstration_that_fails_is_told_at_its_end_and_costs_the_session_nothing(
    make: Maker, tmp_path: Path, episode: Episode, opening: list[Message]
) -> None:
    said = notices(make, 5)
    async with open_studio(tmp_path, episode, Room()) as studio:
        path = await studio.begin(lambda: [*opening, make(Notice, time_s=float("nan"))])
        await write(studio, said)
        with pytest.raises(RecordingError, match=r"demo1.* is incomplete"):
            await studio.end("success", operator="Ada")
        await write(studio, notices(make, 1))
        gone = await studio.begin(lambda: opening)
        await anyio.Path(gone).unlink()
        with pytest.raises(RecordingError, match=r"demo2.* is incomplete"):
            await studio.end("success", operator="Ada")
    assert len(await read(studio.path)) == 7
    assert ids(await read(path))[:4] == ids(await read(path, [Episode])) + ids(opening)


async def test_many_tasks_may_write_while_demonstrations_come_and_go(
    make: Maker, tmp_path: Path, episode: Episode, opening: list[Message]
) -> None:
    paths = list[Path]()
    frame = make(Frame, cause=())

    async with open_studio(tmp_path, episode, Room()) as studio, anyio.create_task_group() as group:

        async def stage() -> None:
            for notice in notices(make, 60):
                await studio.write(notice)
                await studio.write(replace(frame, id=make(Goal).id))

        for _ in range(3):
            group.start_soon(stage)
        for _ in range(3):
            paths.append(await studio.begin(lambda: opening))
            await anyio.sleep(0.02)
            await studio.end("success", operator="Ada")
    whole = ids(await read(studio.path))
    for path in paths:
        part = ids(await read(path))[4:]
        first = whole.index(part[0]) if part else 0
        assert whole[first : first + len(part)] == part


# Clips ------------------------------------------------------------------------------------------------------------


async def test_a_clip_holds_the_last_seconds_and_nothing_older_but_what_it_begins_with(
    make: Maker, tmp_path: Path, episode: Episode
) -> None:
    old = [make(kind, cause=()) for kind in (Model, Goal, Mode, Model)] + notices(make, 2)
    frames, late = [make(Frame, cause=()) for _ in range(6)], notices(make, 3)
    async with open_studio(tmp_path, episode, Room()) as studio:
        await write(studio, [old[0], old[1], frames[0], old[2], frames[1], old[3], *old[4:], frames[2]])
        await anyio.sleep(0.3)
        began_s = time.monotonic()
        await write(studio, [late[0], *frames[3:], *late[1:]])
        path = await studio.clip(time.monotonic() - began_s + 0.1)
        assert path.name == f"{studio.path.stem}-clip1.mcap"
        assert await to_thread.run_sync(check, path) == []
        began, *rest = await read(path)
        await write(studio, notices(make, 1))
    assert isinstance(began, Episode)
    assert json.loads(began.config) == {"preset": "cpu", "clip": 1, "session": studio.path.name}
    expected = [old[1], old[2], old[3], late[0], *frames[3:], *late[1:]]
    assert ids(rest) == ids(expected)
    assert all(same_as_read(a, b) for a, b in zip(expected, rest, strict=True))
    assert (await to_thread.run_sync(entry, path)).duration_s < time.monotonic() - began_s


async def test_a_clip_of_more_than_there_is_holds_all(make: Maker, tmp_path: Path, episode: Episode) -> None:
    said = [make(kind, cause=()) for kind in (Model, Goal, Notice, Frame, Mode, Notice)]
    async with open_studio(tmp_path, episode, Room()) as studio:
        await write(studio, said)
        path = await studio.clip(1e6)
        assert await to_thread.run_sync(check, path) == []
        read_back = await read(path)
    assert ids(read_back)[1:] == ids(said)
    assert [type(message) for message in read_back].count(Episode) == 1


async def test_a_clip_in_which_nothing_was_said_is_refused_and_leaves_nothing(
    make: Maker, tmp_path: Path, episode: Episode
) -> None:
    async with open_studio(tmp_path, episode, Room()) as studio:
        await write(studio, notices(make, 2))
        await anyio.sleep(0.1)
        with pytest.raises(RecordingError, match="Nothing was recorded in that time"):
            await studio.clip(0.05)
    assert files_in(tmp_path) == {studio.path.name, digests.SUMS}


async def test_writing_goes_on_while_clips_are_cut(make: Maker, tmp_path: Path, episode: Episode) -> None:
    said, paths = notices(make, 300), list[Path]()
    async with open_studio(tmp_path, episode, Room()) as studio:
        await studio.write(make(Frame, cause=()))

        async def go_on() -> None:
            for message in said:
                await studio.write(message)
                await anyio.sleep(0.002)

        async with anyio.create_task_group() as group:
            group.start_soon(go_on)
            for _ in range(4):
                await anyio.sleep(0.1)
                paths.append(await studio.clip(0.2))
    whole = ids(await read(studio.path, [Notice]))
    assert whole == ids(said)
    for path in paths:
        part = ids(await read(path, [Notice]))
        first = whole.index(part[0])
        assert whole[first : first + len(part)] == part
        assert len(part) > 10


async def test_a_clip_holds_what_was_written_just_before_it_was_asked_for(
    make: Maker, tmp_path: Path, episode: Episode
) -> None:
    frames = [make(Frame, cause=()) for _ in range(20)]
    async with open_studio(tmp_path, episode, Room()) as studio:
        await write(studio, frames)
        path = await studio.clip(60.0)
        assert ids(await read(path, [Frame])) == ids(frames)


async def test_a_clip_of_a_session_that_is_over_is_refused(tmp_path: Path, episode: Episode) -> None:
    async with open_studio(tmp_path, episode, Room()) as studio:
        pass
    with pytest.raises(RecordingError, match="closed already"):
        await studio.clip(1.0)


# A crash ----------------------------------------------------------------------------------------------------------

_SESSION = """
import sys, time
from pathlib import Path
import anyio
from app.core.messages import Episode, Frame, Goal, Notice
from app.recording.write.preflight import Room
from app.recording.library.session_recorder import open_studio
from tests.recording.samples import Maker

async def main():
    make = Maker(seed=3)
    async with open_studio(Path(sys.argv[1]), make(Episode), Room()) as studio:
        frame = make(Frame)
        await studio.begin(lambda: [make(Goal)])
        for count in range(100_000):
            await studio.write(make(Notice, text=str(count), time_s=time.monotonic()))
            if count % 10 == 0:
                await studio.write(frame)
            print(count, flush=True)
            await anyio.sleep(0.02)

anyio.run(main)
"""


@pytest.mark.serial
def test_a_kill_costs_at_most_the_last_second_of_both_files(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", _SESSION, str(tmp_path)], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        for line in child.stdout:
            if int(line) >= 100:
                break
        killed_s = time.monotonic()
        child.send_signal(signal.SIGKILL)
    paths = list(tmp_path.glob("*.mcap"))
    assert len(paths) == 2
    for path in paths:
        recovered = recover(path)
        assert recovered.lost_bytes == 0
        said = [cast(Notice, message) for message in read_messages(recovered.path, [Notice])]
        assert [notice.text for notice in said] == [str(count) for count in range(len(said))]
        assert killed_s - said[-1].time_s < 1.0
