"""The whole program in a real browser: the operator demonstrates a push by hand, and other programs learn from it."""

import json
import re
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import final

import numpy as np
import pytest
from playwright.sync_api import Page, WebSocket, expect

from app.core.dialogue.control import EndRequest
from app.core.dialogue.requests import ClipRequest, GoalRequest, TakeRequest
from app.core.geometry.chamfer import chamfer_m2
from app.core.messages import Episode, Executed, Frame, Goal, Message, Model, Particles, Proposal, Transition
from app.recording.exchange.model_file import load_model
from app.recording.read.reader import read_messages, read_transitions
from tests.conftest import ROOT
from tests.ui.test_browser import SECONDS
from tests.ui.test_whole_cell import address, command, heeding_interrupts, started

pytestmark = [pytest.mark.browser, pytest.mark.slow]
__all__ = ["heeding_interrupts"]

PATIENCE_S = 120
SEED = "10"
"""Seed of a rope that lies across the path of a tool which comes from the arm's waiting place."""
SHARE = 0.5
X, Y, Z = 0, 1, 2
ASIDE_M, THERE_M, DOWN_M, PUSH_M, UP_M = 0.08, 0.10, 0.292, 0.13, 0.15
"""Distances [m] of the hand: aside to where the rope lies across; nearer to it; almost to the table; into it; up."""
SELDOM_DRAWN = "requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 1000)"
"""Script for fewer drawings: in software one takes longer than a held key may wait, and cores that others need."""


def dipac(*words: object) -> str:
    """Output of a command of the program, which has to succeed."""
    done = subprocess.run(command(*words), cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture
def console(heeding_interrupts: None, tmp_path: Path) -> Iterator["subprocess.Popen[str]"]:
    """`dipac console` as a user starts it; one that calibrates would compile that for longer than this test takes."""
    options = ("--seed", SEED, "--port", 0, "--preset", "cpu", "--no-calibrate")
    with started("console", "rope_push", *options, "--recordings", tmp_path / "recordings") as process:
        yield process


@final
class Hand:
    """Holds keys of the page until the tool is somewhere, and presses again those that the page asks for."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._again, self._said = False, ""
        self._at: list[float] | None = None
        page.on("websocket", self._listen)

    def hold(self, *ways: tuple[str, int, float]) -> None:
        """Hold each key until the tool has gone so far [m] along an axis, and the next before the last is released."""
        held = ""
        for key, axis, distance_m in ways:
            self._page.keyboard.down(key)
            if held:
                self._page.keyboard.up(held)
            held = key
            self._go(key, axis, distance_m)
        self._page.keyboard.up(held)

    def _go(self, key: str, axis: int, distance_m: float) -> None:
        start, begun_s = self._at, time.monotonic()
        while start is None or self._at is None or abs(self._at[axis] - start[axis]) < distance_m:
            start = start or self._at
            assert time.monotonic() - begun_s < PATIENCE_S, f"The tool is not moved by {key}: {self._said}."
            self._page.wait_for_timeout(10)
            if self._again:
                self._page.keyboard.up(key)
                self._page.keyboard.down(key)
                self._again = False

    def _listen(self, socket: WebSocket) -> None:
        if socket.url.endswith("/jog"):
            socket.on("framereceived", lambda said: self._hear(str(said)))

    def _hear(self, said: str) -> None:
        answer = json.loads(said)
        self._said, self._at = answer["says"], answer["at"]
        self._again = "press again" in self._said


def opened(console: "subprocess.Popen[str]", page: Page) -> Page:
    page.context.add_init_script(SELDOM_DRAWN)
    page.set_viewport_size({"width": 1100, "height": 700})
    page.set_default_timeout(PATIENCE_S * SECONDS)
    expect.set_options(timeout=PATIENCE_S * SECONDS)
    page.goto(address(console))
    expect(page.get_by_role("button", name="By hand", exact=True)).to_be_visible()
    return page


def demonstrate(page: Page, hand: Hand) -> None:
    """Move by hand, recorded as a success: one motion, or more where the machine is too busy to keep a key held."""
    page.get_by_role("button", name="By hand", exact=True).click()
    expect(page.get_by_text("Waiting to be moved by hand")).to_be_visible()
    page.get_by_text("Demonstrations", exact=True).click()
    page.get_by_role("button", name="Start a demonstration").click()
    expect(page.get_by_text("Recording number 1")).to_be_visible()
    page.locator("#dp-jog-speed").fill(f"{100 * SHARE:.0f}")
    hand.hold(("a", Y, ASIDE_M), ("s", X, THERE_M), ("f", Z, DOWN_M), ("s", X, PUSH_M), ("r", Z, UP_M))
    expect(page.get_by_text(re.compile("[1-9] motions? so far"))).to_be_visible()
    page.get_by_role("button", name="Success").click()
    expect(page.get_by_text("Number 1: success")).to_be_visible()
    expect(page.get_by_text("1 of 10 succeeded")).to_be_visible()


def keep(page: Page) -> None:
    """Make the view the goal, and keep the last recording as a file of its own."""
    page.get_by_role("tab", name="Goal").click()
    page.get_by_role("button", name="Current view as goal").click()
    page.get_by_role("button", name="Save the last 30 seconds").click()
    page.get_by_role("tab", name="Cell").click()
    expect(page.get_by_text("The current view as goal is set").first).to_be_visible()
    expect(page.get_by_text("The last 30 s are kept in").first).to_be_visible()


def end(console: "subprocess.Popen[str]", page: Page) -> None:
    """End the session, from a page that may complain that nobody answers any more; its complaints are ignored."""
    other = page.context.new_page()
    other.goto(page.url)
    page.close()
    other.get_by_role("tab", name="View").click()
    other.get_by_text("End the session").click()
    other.get_by_role("button", name="End it now").click()
    assert console.wait(timeout=PATIENCE_S) == 0
    other.close()


def files(folder: Path) -> tuple[Path, Path, Path]:
    """The recordings of the session, the demonstration and the clip."""
    (demo,), (clip,) = folder.glob("*-demo1-*.mcap"), folder.glob("*-clip1.mcap")
    (session,) = {*folder.glob("*.mcap")} - {demo, clip}
    return session, demo, clip


def index(messages: list[Message], kind: type[Message]) -> int:
    """Index of the first message of `kind`."""
    return next(number for number, message in enumerate(messages) if isinstance(message, kind))


def check_demonstration(path: Path) -> int:
    """Check that it has motions, which moved the rope, and before them all that learning needs; return their number."""
    said = list(read_messages(path))
    assert isinstance(said[0], Episode)
    first = index(said, Transition)
    assert max(index(said, kind) for kind in (Goal, Model, Frame, Particles)) < index(said, Executed) < first
    transitions = read_transitions(path)
    assert {transition.executed.outcome for transition in transitions} == {"completed"}
    way = np.concatenate([transition.executed.measured for transition in transitions])
    assert way[:, 2].min() < 0.01
    assert way[-1, 0] - way[0, 0] > 0.2
    assert chamfer_m2(transitions[0].before, transitions[-1].after) > 2 * 0.003**2
    assert not any(isinstance(message, Proposal) for message in said)
    return len(transitions)


def check_commands(session: Path, demo: Path, clip: Path, folder: Path, motions: int) -> None:
    """Check that the program's commands read its recordings."""
    assert "3 of 3 recordings are good" in dipac("recordings", "check", session, demo, clip)
    shown = dipac("recordings", "show", demo)
    assert "success (client 0)" in shown
    assert f"{motions} pushes of 1 recordings" in dipac(
        "recordings", "export", demo, "--to", "npz", "-o", folder / "npz"
    )
    (arrays,) = (folder / "npz").glob("*.npz")
    dipac("import", arrays, "-o", folder / "again.mcap")
    assert len(read_transitions(folder / "again.mcap")) == motions


def check_replay(demo: Path) -> None:
    """Check that a replay is served from any moment on, until it is interrupted."""
    with started("replay", demo, "--at", 1, "--port", 0) as replay:
        assert address(replay).startswith("http://127.0.0.1:")
        replay.send_signal(signal.SIGINT)
        assert replay.wait(timeout=30) == 128 + signal.SIGINT


def check_calibration(demo: Path, folder: Path, motions: int) -> None:
    """Check that a model is learnt from it."""
    said = dipac("calibrate", demo, "-o", folder / "model.toml")
    assert f"to {motions} transitions of 1 recordings" in said
    assert load_model(folder / "model.toml", task="rope_push@rods", time_s=0.0).transition_count == motions


def check_dataset(demo: Path, folder: Path) -> None:
    """Check that another program reads it as one episode that succeeded."""
    datasets = pytest.importorskip("datasets", reason="The package `datasets` is missing; install dipac[lerobot].")
    assert "1 episodes" in dipac("recordings", "export", demo, "--to", "lerobot", "-o", folder / "lerobot")
    rows = datasets.Dataset.from_parquet(
        [str(path) for path in (folder / "lerobot" / "data").glob("*/*.parquet")], cache_dir=str(folder / "cache")
    )
    steps = rows.select_columns(["observation.state", "next.success"]).with_format("numpy")[:]
    assert np.ptp(steps["observation.state"][:, 0]) > 0.2
    assert steps["next.success"].nonzero()[0].tolist() == [len(rows) - 1]


def test_what_is_demonstrated_in_the_browser_is_a_recording_that_other_programs_learn_from(
    console: "subprocess.Popen[str]", browser_page: Page, tmp_path: Path
) -> None:
    hand = Hand(browser_page)
    page = opened(console, browser_page)
    demonstrate(page, hand)
    keep(page)
    end(console, page)
    session, demo, clip = files(tmp_path / "recordings")
    assert len(list(read_messages(session, [Goal]))) == 2
    for kind in (GoalRequest, ClipRequest, TakeRequest, EndRequest):
        assert any(read_messages(session, [kind]))
    motions = check_demonstration(demo)
    check_commands(session, demo, clip, tmp_path, motions)
    check_calibration(demo, tmp_path, motions)
    check_replay(demo)
    check_dataset(demo, tmp_path)
