"""A SIGKILL in the middle of an episode loses at most the last second."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from app.core.errors import RecordingError
from app.core.messages import Episode, Frame, Notice
from app.recording.library.recover import recover
from app.recording.read.reader import read_messages

pytestmark = pytest.mark.serial

_EPISODE = """
import sys, time
from pathlib import Path
from dataclasses import replace
import anyio
from app.core.messages import Episode, Frame, Notice, fresh_id
from app.recording.write.preflight import Room
from app.recording.write.writer import open_recording
from tests.recording.samples import Maker

async def main():
    make = Maker(seed=3)
    rest_after = int(sys.argv[2])
    async with open_recording(Path(sys.argv[1]), make(Episode), Room()) as recorder:
        frame = make(Frame)
        for count in range(100_000):
            await recorder.write(make(Notice, text=str(count), time_s=time.monotonic()))
            if count % 10 == 0:
                await recorder.write(replace(frame, id=fresh_id("frame")))
            if count == rest_after:
                await recorder.flush()
            print(count, flush=True)
            await anyio.sleep(60.0 if count == rest_after else 0.02)

anyio.run(main)
"""
"""Episode of fifty notices and five image pairs a second; prints each notice's number, and may rest after one."""

_LAST = 120
"""The notice after which the kill comes."""
_NEVER = -1


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int, float]:
    """Remains of an episode that was killed while it wrote."""
    return _killed(tmp_path_factory.mktemp("killed"), rest_after=_NEVER)


def _killed(folder: Path, rest_after: int) -> tuple[Path, int, float]:
    """Remains of a killed episode: its file, the last notice that the recorder took, and the moment of the kill [s]."""
    episode = [sys.executable, "-c", _EPISODE, str(folder), str(rest_after)]
    with subprocess.Popen(episode, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        for line in child.stdout:
            if int(line) >= _LAST:
                break
        killed_at_s = time.monotonic()
        child.send_signal(signal.SIGKILL)
        last = max([int(line) for line in child.stdout], default=_LAST)
    (path,) = folder.glob("*.mcap")
    return path, last, killed_at_s


def test_the_reader_names_the_command_that_mends_the_file(killed: tuple[Path, int, float]) -> None:
    path, _, _ = killed
    with pytest.raises(RecordingError, match=rf"cut off.*`dipac recover {path}`"):
        read_messages(path)


def test_at_most_the_last_second_is_lost(killed: tuple[Path, int, float]) -> None:
    path, last, killed_at_s = killed
    read = list(read_messages(recover(path).path))
    assert isinstance(read[0], Episode)
    notices = [message for message in read if isinstance(message, Notice)]
    # No hole: everything up to the last one that is there.
    assert [notice.text for notice in notices] == [str(count) for count in range(len(notices))]
    assert sum(isinstance(message, Frame) for message in read) >= len(notices) // 10
    assert len(notices) <= last + 1
    assert killed_at_s - notices[-1].time_s < 1.0


@pytest.mark.serial
def test_what_was_flushed_is_whole_in_the_file_of_a_killed_episode(tmp_path: Path) -> None:
    # Killed at rest: a kill in the middle of a write may cut that write short.
    path, last, _ = _killed(tmp_path, rest_after=_LAST)
    recovered = recover(path)
    assert recovered.lost_bytes == 0
    notices = [message for message in read_messages(recovered.path) if isinstance(message, Notice)]
    assert [notice.text for notice in notices] == [str(count) for count in range(last + 1)]
