"""A console that is being served, and a browser to look at it with."""

import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import final

import anyio
import numpy as np
import pytest
from anyio.from_thread import start_blocking_portal
from playwright.sync_api import ConsoleMessage, Page, sync_playwright

from app.config import Limits
from app.core.dialogue.control import Lease
from app.core.dialogue.jog import Jog
from app.core.motion import pointing_down
from app.teleop import Pilot
from app.teleop.sample import Sample, read_sample
from app.ui import Console, open_console
from app.ui.parts.operator_controller import Request
from bench.browser import FLAGS, MISSING, chromium
from tests.ui import synthetic

UNATTENDED = (
    "--headless=new",
    "--hide-scrollbars",
    "--mute-audio",
    "--disable-background-timer-throttling",
    "--disable-backgrounding-occluded-windows",
    "--disable-renderer-backgrounding",
)
"""Options by which a page works as if somebody looked at it, whichever other pages there are."""
THROTTLED_S = 0.05
"""Time [s] in which viser's page sends one message; of those that wait for the next one, all but the last are lost."""

UNHURRIED = """{
  let drawn = 0, last = 0, took = 0, frames = 0, draws = true;
  const frame = (now) => {
    if (frames++ < 3) took = Math.max(took, now - last);
    last = now;
    draws = now - drawn >= Math.max(4000, 4 * took);
    if (draws) [drawn, took, frames] = [now, 0, 0];
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
  const gl = WebGL2RenderingContext.prototype;
  for (const name of ["clear", "drawArrays", "drawElements", "drawArraysInstanced", "drawElementsInstanced"]) {
    const call = gl[name];
    gl[name] = function (...given) { if (draws) call.apply(this, given); };
  }
}"""
"""Script that skips most frames of the scene, and more where one takes long.

In software each takes two processors 0.2 s, beside other work 4 s, which page, server and arm need; and a click waits
for two frames of its page.
"""


@final
class Held:
    """The hand of the console: notes the samples that came in, what was answered, and the jogs that came of them."""

    def __init__(self) -> None:
        self.samples: list[tuple[str, Sample]] = []
        self.said: list[str] = []
        self.jogs: list[Jog] = []
        self.aims: list[np.ndarray] = []
        self._pilot = Pilot(jog=self._jog, tool=lambda: pointing_down(np.array([0.42, -0.12, 0.12])), limits=Limits())

    @property
    def holds(self) -> bool:
        """True if anything is held, by the last sample."""
        return bool(self.samples) and self.samples[-1][1].held

    def sample(self, operator: str, data: bytes, *, refused: str | None) -> str:
        said = self._pilot.sample(operator, data, refused=refused)
        self.samples.append((operator, read_sample(data)))
        self.said.append(said)
        return said

    def tool(self) -> np.ndarray:
        return self._pilot.tool()

    def let_go(self, operator: str) -> None:
        self._pilot.let_go(operator)

    def aim(self, position: np.ndarray) -> None:
        self.aims.append(position)
        self._pilot.aim(position)

    def _jog(self, jog: Jog) -> bool:
        self.jogs.append(jog)
        return True


@dataclass
class Served:
    """A console on a free port, whose program runs in another thread; what was asked of it, and whether it stopped."""

    console: Console
    stopped: threading.Event = field(default_factory=threading.Event)
    held: Held = field(default_factory=Held)
    requests: list[Request] = field(default_factory=list)
    heard: threading.Semaphore = field(default_factory=lambda: threading.Semaphore(0))

    def next_request(self) -> Request:
        """The next request that has not been taken yet, apart from those that take control for it.

        The page may be touched again afterwards: whatever it sends sooner, viser's client may drop.
        """
        while True:
            assert self.heard.acquire(timeout=20), "The console sent no request."
            request = self.requests.pop(0)
            if not isinstance(request, Lease):
                time.sleep(2 * THROTTLED_S)
                return request


@pytest.fixture
def served() -> Iterator[Served]:
    stopped, held = threading.Event(), Held()
    with start_blocking_portal("asyncio") as portal:
        opening = open_console(
            host="127.0.0.1", port=0, title="dipac rope_push", cell="simulated", stop=stopped.set, hand=held
        )
        with portal.wrap_async_context_manager(opening) as console:
            served = Served(console=console, stopped=stopped, held=held)

            async def listen() -> None:
                async for request in console.requests():
                    served.requests.append(request)
                    served.heard.release()

            async def report() -> None:
                while True:
                    console.show(synthetic.health())
                    await anyio.sleep(0.5)

            tasks = [portal.start_task_soon(task) for task in (listen, report)]
            yield served
            for task in tasks:
                task.cancel()


FAILED = pytest.StashKey[bool]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]):
    report = yield
    item.stash[FAILED] = item.stash.get(FAILED, False) or report.failed
    return report


@pytest.fixture(scope="session")
def browser_address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of the one headless Chromium of all tests (Chrome DevTools Protocol); each page has its own context."""
    executable = chromium()
    if executable is None:
        pytest.skip(MISSING)
    profile = tmp_path_factory.mktemp("profile")
    port = profile / "DevToolsActivePort"
    options = [*FLAGS, *UNATTENDED, "--remote-debugging-port=0", f"--user-data-dir={profile}"]
    with subprocess.Popen([executable, *options, "about:blank"], stderr=subprocess.DEVNULL) as browser:
        try:
            while not (port.is_file() and port.read_text(encoding="utf-8").count("\n")):
                assert browser.poll() is None, f"{executable} ended as it started."
                time.sleep(0.05)
            yield f"http://127.0.0.1:{port.read_text(encoding='utf-8').split()[0]}"
        finally:
            browser.terminate()


@pytest.fixture
def new_page(request: pytest.FixtureRequest, browser_address: str) -> Iterator[Callable[[], Page]]:
    """Opens pages, each in a fresh context; of a test that failed, what they showed is in the report.

    Contexts have windows of their own: of pages in one window, those behind are drawn once a second, and a click waits
    for drawing. At the end the test fails where a page reported an error or asked any other machine for anything. Name
    it after the fixture that serves, so that pages are closed before the server is.
    """
    complaints, opened = list[str](), list[Page]()
    with sync_playwright() as playwright:
        browser = playwright.chromium.connect_over_cdp(browser_address)

        def new() -> Page:
            context = browser.new_context(viewport={"width": 1600, "height": 900})
            context.add_init_script(UNHURRIED)
            page = context.new_page()
            page.on("pageerror", lambda error: complaints.append(f"error: {error}"))
            page.on("console", lambda said: complaints.append(said.text) if complains(said) else None)
            page.on("request", lambda request: None if is_local(request.url) else complaints.append(request.url))
            opened.append(page)
            return page

        yield new
        for page in opened:
            if request.node.stash[FAILED] and not page.is_closed():
                request.node.add_report_section("teardown", "page", page.locator("body").aria_snapshot())
            page.context.close()
    assert complaints == []


@pytest.fixture
def browser_page(new_page: Callable[[], Page]) -> Page:
    """A page as `new_page` opens it."""
    return new_page()


def is_local(url: str) -> bool:
    return url.startswith(("http://127.0.0.1:", "ws://127.0.0.1:", "data:", "blob:"))


def complains(said: ConsoleMessage) -> bool:
    """True if the page reports an error, unless it is about a picture that was replaced before it was drawn."""
    return said.type == "error" and not said.location["url"].startswith("blob:")
