"""A system ends the program in order: tasks close what they hold, children wait for that, and one line is said."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from app.recording.library.checks import check
from tests.conftest import ROOT

pytestmark = pytest.mark.serial

PROGRAM = """
import signal
import sys
from pathlib import Path
import anyio
from app.__main__ import exit_code_of
from app.core.messages import Episode, Notice, fresh_id
from app.core.system.signals import system_interrupts
from app.core.system.worker import Worker
from app.recording.write.preflight import Room
from app.recording.write.writer import open_recording

EPISODE = Episode(
    id=fresh_id("episode"), time_s=1.0, task="rope_push", rig="none", seed=0, simulated=True, code_version="0",
    config="{}",
)

def wait_for_end() -> None:
    print("ready", flush=True)
    while True:
        signal.pause()

async def record() -> None:
    async with open_recording(Path(sys.argv[1]), EPISODE, Room()) as recorder, Worker("planner") as worker:
        await recorder.write(Notice(id=fresh_id("notice"), time_s=1.0, where="test", text="begun"))
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(worker.run, wait_for_end)
            await anyio.sleep_forever()

if __name__ == "__main__":
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # These tests may themselves run under `nohup`.
    signal.signal(signal.SIGINT, signal.SIG_IGN if sys.argv[2] else signal.default_int_handler)
    with system_interrupts() as ending:
        sys.exit(exit_code_of(lambda: anyio.run(record), ending))
"""


def ended_by(number: signal.Signals, folder: Path, *, interrupts: bool = True, group: bool = True) -> tuple[int, str]:
    """Exit code and last words of a program that records while its worker computes, and gets the signal then."""
    file = folder / "program.py"
    file.write_text(PROGRAM)

    with subprocess.Popen(
        [sys.executable, file, folder, "" if interrupts else "background"],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as running:
        try:
            assert running.stdout is not None
            assert running.stderr is not None
            assert running.stdout.readline() == "ready\n"
            (os.killpg if group else os.kill)(running.pid, number)
            said = running.stderr.read()
            return running.wait(30), said
        finally:
            running.kill()


@pytest.mark.parametrize(
    ("number", "how"),
    [
        (signal.SIGTERM, {}),
        (signal.SIGTERM, {"group": False, "interrupts": False}),
        (signal.SIGHUP, {}),
        (signal.SIGINT, {}),
    ],
    ids=["systemd", "background", "terminal", "ctrl-c"],
)
def test_a_signal_of_the_system_closes_the_recording_and_is_said_in_one_line(number, how, tmp_path):
    code, said = ended_by(number, tmp_path, **how)
    reason = "interrupted" if number == signal.SIGINT else f"ended by {number.name}"
    assert (code, said) == (128 + number, f"dipac: {reason}\n")
    (recording,) = tmp_path.glob("*.mcap")
    assert check(recording) == []


def test_a_child_process_ends_by_itself_only_where_its_parent_does_not_end_it():
    program = (
        "import os, signal\nimport app.core.system.signals as signals\nsignals._ALONE_S = 1\n"
        "signals.leave_end_to_parent()\n"
        "for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM): os.kill(os.getpid(), number)\n"
        "print('alive', flush=True)\nsignal.pause()\nsignal.pause()"
    )
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=30, check=False)
    assert found.stdout == "alive\n"
    assert found.returncode == -signal.SIGALRM
