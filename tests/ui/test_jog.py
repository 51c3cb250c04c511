"""Moving the tool by hand in a real browser: what is held arrives, and what is not held any more ends at once."""

import time
from collections.abc import Callable

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from app.teleop.sample import Axes
from tests.ui import synthetic
from tests.ui.conftest import Held, Served
from tests.ui.test_browser import SECONDS, wait_until

pytestmark = pytest.mark.browser


def opened(page: Page, served: Served) -> Page:
    """Page of somebody who has control, in teleoperation."""
    for message in synthetic.scene()[:-1]:
        served.console.show(message)
    page.set_default_timeout(30 * SECONDS)
    expect.set_options(timeout=30 * SECONDS)
    page.goto(served.console.url)
    page.get_by_role("button", name="Take", exact=True).click()
    expect(page.get_by_text("client 0 has control")).to_be_visible()
    expect(page.locator("#dp-jog")).to_be_hidden()
    served.console.show(synthetic.arm())
    served.console.show(synthetic.mode("teleoperate"))
    expect(page.locator("#dp-jog")).to_be_visible()
    return page


def held_by(served: Served, press: Callable[[], object]) -> Axes:
    """Axes in the samples once `press` has been done and something is held."""
    press()
    wait_until(lambda: served.held.holds)
    return served.held.samples[-1][1].axes


def quiet(held: Held) -> bool:
    """True if nothing is held, and no more samples come."""
    count = len(held.samples)
    time.sleep(0.3)
    return not held.holds and len(held.samples) == count


def connected(page: Page, served: Served) -> None:
    """Press a key until the press is heard."""

    def heard() -> bool:
        page.keyboard.press("h", delay=150)
        return len(served.held.samples) > 0

    wait_until(heard)
    wait_until(lambda: quiet(served.held))


def test_a_key_that_is_held_moves_the_tool_until_it_is_released(served: Served, browser_page: Page) -> None:
    page = opened(browser_page, served)
    connected(page, served)
    begun = len(served.held.samples)
    assert held_by(served, lambda: page.keyboard.down("w")) == Axes(x=-1.0)
    wait_until(lambda: len(served.held.samples) > begun + 8)
    page.keyboard.down("r")
    wait_until(lambda: served.held.samples[-1][1].axes == Axes(x=-1.0, z=1.0))
    page.keyboard.up("r")
    page.keyboard.up("w")
    wait_until(lambda: quiet(served.held))
    presses = {sample.pressed for _, sample in served.held.samples[begun:]}
    assert len(presses) == 1, "a second key is no new press"
    assert {operator for operator, _ in served.held.samples} == {"client 0"}
    assert "moving" in served.held.said[begun:]
    assert any(jog.linear[0] < 0 for jog in served.held.jogs)
    assert not served.held.jogs[-1].linear.any()


def test_buttons_speed_frame_and_there_are_held_with_the_mouse(served: Served, browser_page: Page) -> None:
    page = opened(browser_page, served)
    connected(page, served)
    page.locator("#dp-jog-speed").fill("80")
    page.get_by_role("radio", name="the tool").check()
    page.get_by_role("button", name="turn left").hover()
    assert held_by(served, page.mouse.down) == Axes(yaw=1.0)
    assert (served.held.samples[-1][1].speed, served.held.samples[-1][1].frame) == (0.8, "tool")
    # A pointer that slips off the button holds it still: it is captured, and its release is heard wherever it is.
    page.mouse.move(800, 300)
    time.sleep(0.3)
    assert served.held.holds
    page.mouse.up()
    wait_until(lambda: quiet(served.held))

    # The handle was placed at the tool; nobody has dragged it.
    assert served.held.aims[-1] == pytest.approx(np.array([0.42, -0.12, 0.12]))
    page.get_by_role("button", name="Go there").hover()
    page.mouse.down()
    wait_until(lambda: served.held.samples[-1][1].towards)
    page.mouse.up()
    wait_until(lambda: quiet(served.held))


@pytest.mark.parametrize("event", ["blur", "pagehide", "hidden"])
def test_a_page_that_is_left_lets_go_and_wants_a_new_press(served: Served, browser_page: Page, event: str) -> None:
    page = opened(browser_page, served)
    connected(page, served)
    held_by(served, lambda: page.keyboard.down("s"))
    if event == "hidden":
        page.evaluate(
            "Object.defineProperty(document, 'hidden', {value: true, configurable: true});"
            "document.dispatchEvent(new Event('visibilitychange')); delete document.hidden;"
        )
    else:
        page.evaluate(f"window.dispatchEvent(new Event('{event}'))")
    wait_until(lambda: quiet(served.held))
    # A held key goes on repeating; that is no new press.
    page.keyboard.down("s")
    assert quiet(served.held)
    page.keyboard.up("s")
    held_by(served, lambda: page.keyboard.down("s"))
    page.keyboard.up("s")


def test_keys_move_nothing_while_somebody_types_or_the_mode_is_another(served: Served, browser_page: Page) -> None:
    page = opened(browser_page, served)
    connected(page, served)
    count = len(served.held.samples)
    page.evaluate("document.body.append(Object.assign(document.createElement('textarea'), { id: 'typed' }))")
    page.locator("#typed").focus()
    page.keyboard.type("was")
    page.keyboard.press("d", delay=200)
    assert page.locator("#typed").input_value() == "wasd"
    assert len(served.held.samples) == count

    page.locator("#typed").blur()
    held_by(served, lambda: page.keyboard.down("w"))
    served.console.show(synthetic.mode("plan only"))
    expect(page.locator("#dp-jog")).to_be_hidden()
    wait_until(lambda: quiet(served.held))
    page.keyboard.up("w")
    count = len(served.held.samples)
    page.keyboard.press("w", delay=200)
    assert len(served.held.samples) == count


def test_stop_lets_go_and_a_watcher_is_refused_in_words(served: Served, new_page: Callable[[], Page]) -> None:
    page = opened(new_page(), served)
    connected(page, served)
    held_by(served, lambda: page.keyboard.down("w"))
    page.keyboard.press("Escape")
    assert served.stopped.wait(10)
    wait_until(lambda: quiet(served.held))
    page.keyboard.up("w")
    page.keyboard.down("w")
    expect(page.locator("#dp-jog-says")).to_have_text("a stop is in force: press Resume")
    expect(page.locator("#dp-jog-at")).to_have_text("x 420  y -120  z 120 mm")
    page.keyboard.up("w")

    watcher = new_page()
    watcher.goto(served.console.url)
    expect(watcher.get_by_text("You are client 1.")).to_be_visible()
    page.get_by_role("button", name="Resume").click()
    expect(watcher.locator("#dp-jog")).to_be_visible()
    jogs = len(served.held.jogs)

    def refused() -> bool:
        watcher.keyboard.press("w", delay=150)
        return "client 0 has control" in served.held.said

    wait_until(refused)
    assert len(served.held.jogs) == jogs
    watcher.close()


PAD = """
window.pad = { mapping: "standard", axes: [0, 0, 0, 0], buttons: [] };
window.pad.buttons = Array.from({length: 17}, () => ({pressed: false, value: 0}));
navigator.getGamepads = () => [null, window.pad];
"""


def test_a_gamepad_moves_the_tool_while_its_shoulder_button_is_held(served: Served, browser_page: Page) -> None:
    browser_page.add_init_script(PAD)
    page = opened(browser_page, served)
    connected(page, served)
    count = len(served.held.samples)
    page.evaluate("pad.axes = [1, 0.05, 0, -1]; pad.buttons[7].value = 1")
    time.sleep(0.3)
    assert len(served.held.samples) == count, "without the shoulder button nothing is held"

    axes = held_by(served, lambda: page.evaluate("pad.buttons[5].pressed = true"))
    assert axes == Axes(y=1.0, z=1.0, grip=1.0)
    page.evaluate("pad.axes = [0, 0, 0, 0]; pad.buttons[7].value = 0")
    wait_until(lambda: served.held.samples[-1][1].axes == Axes())
    assert served.held.holds
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    wait_until(lambda: quiet(served.held))
    page.evaluate("pad.buttons[5].pressed = false")
    time.sleep(0.2)
    held_by(served, lambda: page.evaluate("pad.buttons[5].pressed = true"))
    page.evaluate("pad.buttons[5].pressed = false")
    wait_until(lambda: quiet(served.held))
