"""A capture process does what it is told, a reset among it, and says what it does."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import pytest

from app.core.system.processes import end, process
from app.rig.realsense.capture import run_capture
from app.rig.realsense.memory import CaptureMemory
from app.rig.realsense.sdk.sdk import Opening, Sdk
from app.rig.realsense.sdk.synthetic import record
from app.rig.realsense.settings import StreamSettings
from tests.rig.realsense.bodies import HEIGHT, WIDTH, Scene, together

SETTINGS = StreamSettings(width=WIDTH, height=HEIGHT, warm_up=0)
PATIENCE_S = 30.0


@dataclass(frozen=True, kw_only=True)
class Lasting:
    """Recorded camera that enters the SDK's list when it is opened, and stays there when it is reset."""

    file: Path
    serial: str = "0123"

    def attach(self, opening: Opening, /) -> AbstractContextManager[None]:
        if not _LISTED:
            _LISTED.append(opening.sdk.context.load_device(str(self.file)))
        opening.pipeline.set_device(_LISTED[0])
        return nullcontext()

    def reset(self, _: Sdk, /) -> None:
        pass


_LISTED: list[object] = []
"""Devices on the SDK's list: each is listed only as long as it is held here."""


@pytest.fixture
def memory(tmp_path: Path) -> Iterator[CaptureMemory]:
    """Shared memory of a capture process with such a camera, which has had no command yet."""
    record(tmp_path / "left.db3", together(), Scene(body=together()).views(30))
    memory = CaptureMemory(SETTINGS)
    source = Lasting(file=tmp_path / "left.db3")
    capturing = process("camera left", run_capture, memory, source, SETTINGS, os.getpid())
    capturing.start()
    yield memory
    memory.closing.value = 1
    end([capturing])


def until(true: Callable[[], object]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < end_s
        time.sleep(0.01)


def does(memory: CaptureMemory, command: int, step: str) -> bool:
    said = memory.last_report
    return said is not None and (said.command, said.step) == (command, step)


@pytest.mark.serial
def test_a_camera_is_opened_and_reset_and_gives_images_after_both(memory: CaptureMemory) -> None:
    assert memory.tell("open") == 1
    until(lambda: does(memory, 1, "streaming"))
    until(lambda: memory.images.count > 3)
    assert memory.tell("reset") == 2
    until(lambda: does(memory, 2, "resetting"))
    until(lambda: does(memory, 2, "streaming"))
    before, pulse_s = memory.images.count, memory.pulse_s
    until(lambda: memory.images.count > before and memory.pulse_s > pulse_s)
    assert memory.identity is not None
    assert memory.identity.serial == "0123"
