"""The whole program in a real browser: the operator sees the rope, approves a push, stops it, and goes on."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from app.core.dialogue.approval import Approved
from app.core.messages import Decision, Executed, Proposal, StopRequest
from app.recording.format.channels import record_of
from app.recording.read.reader import read_messages
from app.ui.parts import palette
from tests.conftest import ROOT
from tests.ui.test_browser import APPROVE, RESUME, SECONDS, STOP, pixels, wait_until

pytestmark = [pytest.mark.browser, pytest.mark.slow]

PATIENCE = 250 * SECONDS
"""Time for a first start: kernels are compiled while a browser renders in software on the same cores."""


SPEED = "0.02"
"""Speed [m/s] at which a push takes so long that a browser which renders in software still stops it in the middle."""


@pytest.fixture
def heeding_interrupts() -> Iterator[None]:
    """Handle SIGINT here, so that programs started from here do not ignore it.

    Jobs in the background of a script ignore SIGINT, and so do the programs that they start, such as these tests. A
    signal that is handled here has its default action in a program started from here; one that is ignored stays so.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def command(*words: object) -> list[str]:
    return [sys.executable, "-m", "app", *map(str, words)]


@contextmanager
def started(*words: object) -> Iterator["subprocess.Popen[str]"]:
    """A command of the program that runs until it is interrupted."""
    with subprocess.Popen(
        command(*words),
        cwd=ROOT,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        try:
            yield process
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(timeout=30)
            finally:
                process.kill()


@pytest.fixture
def console(heeding_interrupts: None, tmp_path: Path) -> Iterator["subprocess.Popen[str]"]:
    """`dipac console` as a user starts it."""
    options = ("--seed", 1, "--port", 0, "--preset", "cpu", "--speed", SPEED)
    with started("console", "rope_push", *options, "--recordings", tmp_path) as process:
        yield process


def address(console: "subprocess.Popen[str]") -> str:
    assert console.stdout is not None
    for line in console.stdout:
        if line.startswith("Operator console: "):
            return line.removeprefix("Operator console: ").strip()
    raise AssertionError("No address was printed.")


def test_a_push_is_approved_stopped_and_resumed(
    console: "subprocess.Popen[str]", browser_page: Page, tmp_path: Path
) -> None:
    page = browser_page
    page.set_default_timeout(PATIENCE)
    expect.set_options(timeout=PATIENCE)
    page.goto(address(console))
    expect(page.locator(".dp-simulated")).to_be_visible()
    wait_until(lambda: pixels(page, palette.OBSERVED) > 300)

    expect(page.get_by_role("button", name=APPROVE)).to_be_enabled()
    page.get_by_role("button", name=APPROVE).click()
    expect(page.get_by_text("pushing")).to_be_visible()
    page.get_by_role("button", name=STOP).click()
    expect(page.get_by_text("stopped").first).to_be_visible()
    page.get_by_role("button", name=RESUME).click()
    expect(page.get_by_role("button", name=APPROVE)).to_be_enabled()

    page.close()  # It would complain, rightly, that nobody answers any more.
    console.send_signal(signal.SIGINT)
    console.wait(timeout=30)
    (recording,) = tmp_path.glob("*.mcap")
    assert console.stdout is not None
    assert f"closing the recording {recording}" in console.stdout.read()
    messages = list(read_messages(recording, [Proposal, Decision, Approved, Executed, StopRequest]))
    (decision,) = [message for message in messages if isinstance(message, Decision)]
    (executed,) = [message for message in messages if isinstance(message, Executed)]
    approved = next(message for message in messages if isinstance(message, record_of(Approved)))
    shown = next(message for message in messages if message.id == decision.proposal_id)
    assert isinstance(shown, Proposal)
    assert decision.digest == shown.motion.digest() == approved.digest
    assert executed.outcome == "stopped"
    assert any(isinstance(message, StopRequest) for message in messages)
    assert len([message for message in messages if isinstance(message, Proposal)]) == 2
