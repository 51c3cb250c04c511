"""A recording in the console, in a real browser: scrubbed, stepped through, played to its end, planned again."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from anyio.from_thread import start_blocking_portal
from playwright.sync_api import Page, expect

from app.commands._player import reel, show
from app.core.errors import UsageError
from app.recording.read.timeline import Timeline, open_timeline
from app.ui import Console, open_console
from app.ui.parts import palette
from app.ui.player import Player
from app.ui.replanning import Replanned, ReplanRequest
from tests.ui import synthetic
from tests.ui.film import DISTANCES_MM, film
from tests.ui.test_browser import APPROVE, SECONDS, pixels, wait_until

pytestmark = pytest.mark.browser

AGAIN = replace(synthetic.proposal(synthetic.rope(0.3), seed=8, branches=4), chamfer_m2=2.5e-3)
AGAIN_MM = "35.4"


@dataclass
class Replayed:
    """A recording on a free port, and whether anything was stopped or asked of the arm."""

    console: Console
    player: Player
    timeline: Timeline
    stopped: list[str]


async def planned(order: ReplanRequest, said: Callable[[str], None]) -> Replanned:
    """Stands in for the planner."""
    said("Compiling nothing.")
    if order.path:
        raise UsageError(f"Cannot read the model {order.path}: No such file or directory.")
    return Replanned(then=None, again=AGAIN, model=order.model)


@pytest.fixture
def replayed(tmp_path: Path) -> Iterator[Replayed]:
    stopped = list[str]()
    with open_timeline(film(tmp_path)) as timeline, start_blocking_portal("asyncio") as portal:
        player = Player(reel(timeline))
        opening = open_console(
            host="127.0.0.1",
            port=0,
            title="dipac session.mcap",
            cell="replay",
            stop=lambda: stopped.append("stop"),
            player=player,
        )
        with portal.wrap_async_context_manager(opening) as console:
            task = portal.start_task_soon(show, player, timeline, console, planned)
            yield Replayed(console=console, player=player, timeline=timeline, stopped=stopped)
            task.cancel()


def opened(page: Page, replayed: Replayed) -> Page:
    page.set_default_timeout(30 * SECONDS)
    expect.set_options(timeout=30 * SECONDS)
    page.goto(replayed.console.url)
    expect(page.get_by_role("status").filter(has_text="REPLAY")).to_be_visible()
    expect(page.get_by_text("of 19.00 s")).to_be_visible()
    return page


def distance(page: Page, millimetres: str) -> None:
    expect(page.get_by_text(f"{millimetres} mm", exact=True)).to_be_visible()


def test_a_recording_is_scrubbed_stepped_through_and_played_to_its_end(replayed: Replayed, browser_page: Page) -> None:
    page = opened(browser_page, replayed)
    expect(page.get_by_text("No plan yet.")).to_be_visible()
    time_box = page.get_by_role("textbox").first
    time_box.fill("4")
    time_box.press("Enter")
    distance(page, DISTANCES_MM[0])
    expect(page.get_by_text("4.00 s", exact=True)).to_be_visible()
    expect(page.get_by_text("Waiting for approval (1 s)")).to_be_visible()
    wait_until(lambda: pixels(page, palette.OBSERVED) > 300)

    page.get_by_role("button", name="Next motion").click()
    expect(page.get_by_text("motion 1 of 3")).to_be_visible()
    page.get_by_role("button", name="Next motion").click()
    expect(page.get_by_text("motion 2 of 3")).to_be_visible()
    distance(page, DISTANCES_MM[1])
    page.get_by_role("button", name="Previous motion").click()
    distance(page, DISTANCES_MM[0])

    page.get_by_label("Moments").click()
    page.get_by_role("option", name="plan 3").click()
    distance(page, DISTANCES_MM[2])

    time_box.fill("0")
    time_box.press("Enter")
    expect(page.get_by_text("No plan yet.")).to_be_visible()
    page.get_by_label("Speed").click()
    page.get_by_role("option", name="10\N{MULTIPLICATION SIGN}", exact=True).click()
    page.get_by_role("button", name="Play", exact=True).click()
    expect(page.get_by_text("19.00 s", exact=True)).to_be_visible()
    expect(page.get_by_text("motion 3 of 3, paused")).to_be_visible()
    expect(page.get_by_text("That was motion 3.").first).to_be_visible()
    distance(page, DISTANCES_MM[2])


def test_nothing_can_be_decided_or_stopped_in_a_replay(replayed: Replayed, browser_page: Page) -> None:
    page = opened(browser_page, replayed)
    replayed.player.jump(3.0)
    distance(page, DISTANCES_MM[0])
    expect(page.get_by_role("button", name="STOP")).to_be_disabled()
    page.keyboard.press("Escape")
    expect(page.get_by_role("button", name=APPROVE)).to_be_hidden()
    expect(page.get_by_role("button", name="Take", exact=True)).to_be_hidden()
    expect(page.get_by_text("Stop delivered")).to_be_hidden()
    assert replayed.stopped == []


def test_a_moment_is_planned_again_and_compared(replayed: Replayed, browser_page: Page) -> None:
    page = opened(browser_page, replayed)
    replayed.player.jump(4.5)
    distance(page, DISTANCES_MM[0])
    page.get_by_text("Plan again", exact=True).click()
    path = page.get_by_role("textbox").first
    path.fill("none.toml")
    page.get_by_role("button", name="Plan from here").click()
    expect(page.get_by_text("Cannot read the model none.toml")).to_be_visible()
    path.fill("")
    page.get_by_role("button", name="Plan from here").click()
    expect(page.get_by_text("Playing on shows what was recorded.")).to_be_visible()
    expect(page.get_by_text("planned again", exact=True)).to_be_visible()
    expect(page.get_by_text(AGAIN.motion.digest()[:12])).to_be_visible()
    page.get_by_text("Replay", exact=True).click()
    page.get_by_role("button", name="Play", exact=True).click()
    expect(page.get_by_text(AGAIN.motion.digest()[:12])).to_be_hidden()
