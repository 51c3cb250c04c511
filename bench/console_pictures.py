"""The pictures of the console in README and docs, taken from the running program: `make pictures`. See `--help`.

It starts `dipac console` as a user does, opens its page in Chromium, measures the rope, approves the first motion,
looks again, and takes the tool in hand.
"""

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

import tyro
from playwright.sync_api import Error, Page

from app.ui.tabs.object_wizard import MEASURE
from bench.browser import console_url, open_browser

IMAGES = Path(__file__).parents[1] / "docs" / "images"
_PATIENCE_MS = 300_000
_SETTLED_MS = 3_000
_PACED = "requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), window.frame_ms)"
"""Drawing in software would take the processors from the planner, which is to be as fast as it is for who has a GPU."""
_SELDOM_MS = 5_000
_DRAWN, _SELDOM = "window.frame_ms = 300", f"window.frame_ms = {_SELDOM_MS}"
_TRIES, _BEGINS_MS = 5, 15_000
_LATER = 4
"""Moments after now, of eight."""
_SIZE = {"width": 1600, "height": 900}


def main(folder: Path = IMAGES, task: str = "rope_push", seed: int = 1) -> None:
    """Write console-plan.png, -object.png, -progress.png, -branches.png and -hand.png into the folder."""
    with tempfile.TemporaryDirectory() as recordings, _program(task, seed, Path(recordings)) as url, _page() as page:
        page.context.add_init_script(f"{_SELDOM}; {_PACED}")
        page.goto(url)
        page.get_by_text("Waiting for your approval").wait_for()
        page.evaluate(_DRAWN)
        page.get_by_text("Software WebGL rendering detected").locator("xpath=../..").get_by_role("button").click()
        _picture(page, folder / "console-plan.png")
        page.get_by_role("tab", name="Object").click()
        page.get_by_role("button", name=MEASURE).click()
        page.get_by_text("Its mass is not seen").wait_for()
        _picture(page, folder / "console-object.png")
        _approve(page)
        page.get_by_text("Progress", exact=True).click()
        page.get_by_text("Distance to the goal").wait_for()
        page.evaluate(_SELDOM)
        page.get_by_text("Waiting for your approval").wait_for()
        _picture(page, folder / "console-progress.png")
        page.get_by_role("tab", name="Plans").click()
        page.get_by_role("slider").first.focus()
        for _ in range(_LATER):
            page.keyboard.press("ArrowRight")
        _picture(page, folder / "console-branches.png")
        page.get_by_role("button", name="By hand", exact=True).click()
        page.get_by_text("Waiting to be moved by hand").wait_for()
        page.get_by_role("tab", name="Cell").click()
        _picture(page, folder / "console-hand.png")


def _picture(page: Page, path: Path) -> None:
    """Take a screenshot after all pending updates are drawn; the element clicked next has to be drawn as well."""
    page.evaluate(_DRAWN)
    page.wait_for_timeout(_SETTLED_MS + _SELDOM_MS)
    page.screenshot(path=path)


def _approve(page: Page) -> None:
    """Approve until a motion is made: on a machine that is busy with drawing, a plan may be rejected as too old."""
    for _ in range(_TRIES):
        page.get_by_role("button", name="Approve this motion").click()
        with suppress(Error):
            page.get_by_text("The arm moves.").wait_for(timeout=_BEGINS_MS)
            return
    raise RuntimeError(f"No motion was made of {_TRIES} that were approved; see the console's messages.")


@contextmanager
def _program(task: str, seed: int, recordings: Path) -> Generator[str]:
    """The running console; yields its URL."""
    command = ["-m", "app", "console", task, "--seed", str(seed), "--port", "0", "--preset", "cpu"]
    with subprocess.Popen(
        [sys.executable, *command, "--recordings", str(recordings)],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
    ) as process:
        assert process.stdout is not None
        try:
            yield console_url(process.stdout)
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(timeout=60)


@contextmanager
def _page() -> Generator[Page]:
    with open_browser() as browser:
        page = browser.new_page(viewport=_SIZE)  # pyright: ignore[reportArgumentType]
        page.set_default_timeout(_PATIENCE_MS)
        yield page


if __name__ == "__main__":
    tyro.cli(main)
