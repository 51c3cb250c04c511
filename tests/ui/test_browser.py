"""The console in a real browser: what the operator sees, and what the buttons do."""

import re
import time
from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from app.core.messages import Decision, Notice, ResumeRequest, StopRequest
from app.ui.parts import palette
from tests.ui import synthetic
from tests.ui.conftest import Served
from tests.ui.test_model_monitor_panel import VERDICT, WATCHED, WRONG

pytestmark = pytest.mark.browser

SECONDS = 1000
APPROVE, REJECT, RESUME, STOP = "Approve this motion", "Reject and plan again", "Resume", "STOP"


def pixels(page: Page, colour: palette.Colour) -> int:
    """Number of pixels between the panels that have about the hue of `colour`, in whatever light."""
    image = cv2.imdecode(np.frombuffer(page.screenshot(), np.uint8), cv2.IMREAD_COLOR)[:, 340:1180]
    hue = cv2.cvtColor(np.uint8([[colour[::-1]]]), cv2.COLOR_BGR2HSV)[0, 0, 0]
    near = cv2.inRange(cv2.cvtColor(image, cv2.COLOR_BGR2HSV), (int(hue) - 6, 120, 80), (int(hue) + 6, 255, 255))
    return int(np.count_nonzero(near))


def wait_until(holds: Callable[[], bool]) -> None:
    for _ in range(60):
        if holds():
            return
        time.sleep(0.5)
    raise AssertionError("It did not come about in 30 s.")


def reason(page: Page) -> Locator:
    """The box for a rejection's reason, which viser's page gives no label that a program could read."""
    return page.get_by_text("Reason", exact=True).locator("xpath=ancestor::*[.//input][1]").locator("input")


def choose(page: Page, label: str, option: str) -> None:
    """The option that is called `option`, whatever more it says behind a comma, of the dropdown beside `label`.

    Without a pointer, from under which what the page draws meanwhile may move the list.
    """
    box, called = page.get_by_role("combobox", name=label, exact=True), re.compile(rf"^{re.escape(option)}(,|$)")
    box.click()
    wanted = page.get_by_role("option", name=called)
    expect(wanted).to_be_visible()
    wanted.dispatch_event("click")
    expect(box).to_have_value(called)


def opened(page: Page, served: Served) -> Page:
    for message in synthetic.scene():
        served.console.show(message)
    page.set_default_timeout(30 * SECONDS)
    expect.set_options(timeout=30 * SECONDS)
    page.goto(served.console.url)
    expect(page.get_by_text("Waiting for your approval")).to_be_visible()
    return page


def test_the_operator_sees_the_cell_and_approves_exactly_the_plan_that_is_shown(
    served: Served, browser_page: Page
) -> None:
    page = opened(browser_page, served)
    expect(page.locator(".dp-simulated")).to_be_visible()
    expect(page.get_by_text("41.3 mm")).to_be_visible()
    expect(page.get_by_text("25.2 mm")).to_be_visible()
    expect(page.get_by_text("compiled rollout and gradient in 11 s")).to_be_visible()
    expect(page.locator("img[src^='blob:']")).to_have_count(2)
    assert "token" not in page.url
    wait_until(lambda: pixels(page, palette.OBSERVED) > 300 and pixels(page, palette.GOAL) > 300)

    replacing = synthetic.proposal(synthetic.rope(0.4), seed=9)
    served.console.show(replacing)
    digest = replacing.motion.digest()
    expect(page.get_by_text(digest[:12])).to_be_visible()
    page.get_by_role("button", name=APPROVE).click()
    decision = served.next_request()
    assert isinstance(decision, Decision)
    assert decision.approve
    assert decision.digest == digest
    assert decision.proposal_id == replacing.id
    assert decision.operator == "client 0"
    expect(page.get_by_role("button", name=APPROVE)).to_be_disabled()


def test_a_rejection_carries_its_reason(served: Served, browser_page: Page) -> None:
    page = opened(browser_page, served)
    reason(page).fill("too close to the edge")
    page.get_by_role("button", name=REJECT).click()
    decision = served.next_request()
    assert isinstance(decision, Decision)
    assert not decision.approve
    assert decision.reason == "too close to the edge"


def test_stop_reaches_the_arm_by_button_and_by_key_and_resume_asks_to_go_on(served: Served, browser_page: Page) -> None:
    page = opened(browser_page, served)
    page.get_by_role("button", name=STOP).click()
    assert served.stopped.wait(10)
    assert isinstance(served.next_request(), StopRequest)
    expect(page.get_by_text("Stop delivered")).to_be_visible()
    expect(page.get_by_role("button", name=APPROVE)).to_be_disabled()

    page.get_by_role("button", name=RESUME).click()
    assert isinstance(served.next_request(), ResumeRequest)
    expect(page.get_by_role("button", name=RESUME)).to_be_hidden()
    expect(page.get_by_role("button", name=APPROVE)).to_be_enabled()

    served.stopped.clear()
    reason(page).focus()
    page.keyboard.press("Escape")
    assert served.stopped.wait(10)
    assert isinstance(served.next_request(), StopRequest)


def test_the_verdict_and_what_the_watch_says_are_seen_and_the_asked_push_is_approved_like_any(
    served: Served, browser_page: Page
) -> None:
    page = opened(browser_page, served)
    served.console.show(VERDICT)
    page.get_by_text("Discovery", exact=True).click()
    expect(page.get_by_text(VERDICT.sentences[0])).to_be_visible()
    expect(page.get_by_text("Viscous film")).to_be_visible()

    plain = synthetic.proposal(synthetic.rope(0.5), seed=3, branches=1)
    served.console.show(replace(plain, branches=(replace(plain.branches[0], origin="asked"),), best=0))
    expect(page.get_by_text("finding out what the model lacks")).to_be_visible()
    page.get_by_role("button", name=APPROVE).click()
    decision = served.next_request()
    assert isinstance(decision, Decision)
    assert (decision.proposal_id, decision.digest) == (plain.id, plain.motion.digest())

    served.console.show(WATCHED)
    expect(page.get_by_text("Right so far, 7 motions")).to_be_visible()
    served.console.show(WRONG)
    expect(page.get_by_text("it seems since motion 5")).to_be_visible()
    expect(page.get_by_text(WRONG.advice)).to_be_visible()


def test_one_browser_has_control_the_others_watch_and_may_stop(served: Served, new_page: Callable[[], Page]) -> None:
    first, second = opened(new_page(), served), new_page()
    second.goto(served.console.url)
    expect(first.get_by_text("You are client 0.")).to_be_visible()
    expect(second.get_by_text("You are client 1.")).to_be_visible()

    second.get_by_role("button", name="Take", exact=True).click()
    expect(first.get_by_text("client 1 has control")).to_be_visible()
    first.get_by_role("button", name=APPROVE).click()
    refused = served.next_request()
    assert isinstance(refused, Notice)
    assert refused.text == "client 0 has no control; client 1 has. Take it first."

    first.get_by_role("button", name=STOP).click()
    assert served.stopped.wait(10)
    assert isinstance(served.next_request(), StopRequest)

    second.close()
    expect(first.get_by_text("Nobody has control")).to_be_visible()
    first.get_by_role("button", name=RESUME).click()
    assert isinstance(served.next_request(), ResumeRequest)
    expect(first.get_by_text("client 0 has control")).to_be_visible()
    first.get_by_role("button", name="Release", exact=True).click()
    expect(first.get_by_text("Nobody has control")).to_be_visible()
