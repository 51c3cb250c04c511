"""The tab Plans in a real browser: branches and moments are chosen, a handle is dragged, and a change is asked for."""

import math
from dataclasses import replace

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from app.config import Workspace
from app.core.dialogue.requests import EditRequest
from app.core.messages import Proposal
from app.ui.plans.look import BEST, NONE, names
from tests.ui import synthetic
from tests.ui.conftest import Served
from tests.ui.test_browser import choose

pytestmark = pytest.mark.browser

SECONDS = 1000
FIELD_OF_VIEW_RAD = math.radians(75)
GRIP_M = 0.255 * 0.12
"""Offset along x and y from a handle's middle to the place where it is dragged over the plane of both."""
MOVED = np.array([0.05, -0.06, 0.0])
SIMULATE = "Simulate this instead"


@pytest.fixture
def page(served: Served, browser_page: Page) -> Page:
    for message in synthetic.scene()[:-1]:
        served.console.show(message)
    browser_page.set_default_timeout(30 * SECONDS)
    expect.set_options(timeout=30 * SECONDS)
    browser_page.goto(served.console.url)
    browser_page.get_by_text("Plans", exact=True).click()
    return browser_page


def set_moment(page: Page, moment: int) -> None:
    number = page.get_by_role("textbox").first
    number.fill(str(moment))
    number.press("Enter")


def cell(page: Page, row: str) -> Locator:
    """Cell of a row in the card of the moment."""
    return page.locator(".dp-moment tr", has_text=row).locator("td").last


def pixel(page: Page, place: np.ndarray) -> tuple[float, float]:
    """Pixel of a place [m] on the screen in the first view, see `app.ui.view.scene`."""
    middle = (np.array(Workspace().low) + np.array(Workspace().high)) / 2
    eye = np.array([middle[0] + 0.75, middle[1] - 0.12, 0.66])
    ahead = np.array([middle[0] - 0.02, middle[1], 0.0]) - eye
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0, 0, 1])
    right /= np.linalg.norm(right)
    x, y, z = np.stack([right, -np.cross(right, ahead), ahead]) @ (place - eye)
    box = page.locator("canvas").first.bounding_box()
    assert box is not None
    focal = box["height"] / 2 / math.tan(FIELD_OF_VIEW_RAD / 2)
    return box["x"] + box["width"] / 2 + focal * x / z, box["y"] + box["height"] / 2 + focal * y / z


def dragged(page: Page, way: tuple[np.ndarray, np.ndarray]) -> None:
    begin, end = (np.array(pixel(page, place)) for place in way)
    page.mouse.move(*begin.tolist())
    page.wait_for_timeout(SECONDS / 2)
    page.mouse.down()
    for share in (0.25, 0.5, 0.75, 1.0):
        page.mouse.move(*(begin + share * (end - begin)).tolist())
        page.wait_for_timeout(SECONDS / 4)
    page.mouse.up()


def test_branches_and_moments_are_looked_at_and_compared(served: Served, page: Page) -> None:
    proposal = synthetic.proposal(synthetic.rope(0.5))
    served.console.show(proposal)
    expect(page.locator(".dp-plans tr.dp-best")).to_contain_text("proposed")
    expect(page.get_by_text("dropped: not finite")).to_be_visible()
    row = page.locator(".dp-plans tr", has_text="3 random").first
    expect(row).to_have_attribute("title", "chamfer: -0.0021; contact: 0.31")
    expect(cell(page, "Moment")).to_have_text("now")

    choose(page, "Look at", "3 random")
    now = cell(page, "3 random").inner_text()
    set_moment(page, 8)
    expect(cell(page, "Moment")).to_contain_text("the end in motion 2 of 2")
    expect(cell(page, "3 random")).not_to_have_text(now)
    choose(page, "Compare with", "10 random")
    assert cell(page, "10 random").inner_text() != cell(page, "3 random").inner_text()

    served.console.show(synthetic.proposal(synthetic.rope(0.4), seed=9))
    expect(page.get_by_role("combobox", name="Look at")).to_have_value(BEST)
    expect(page.get_by_role("combobox", name="Compare with")).to_have_value(NONE)
    expect(cell(page, "Moment")).to_have_text("now")


def test_a_motion_is_changed_by_its_handles_and_the_change_asked_for(served: Served, page: Page) -> None:
    whole = synthetic.proposal(synthetic.rope(0.5))
    proposal: Proposal = replace(whole, branches=whole.branches[:3], best=0)
    served.console.show(proposal)
    choose(page, "Look at", names(proposal)[2])
    expect(page.get_by_role("button", name=SIMULATE)).to_be_disabled()
    page.get_by_text("Edit this motion").click()
    expect(page.get_by_role("button", name=SIMULATE)).to_be_enabled()
    page.wait_for_timeout(2 * SECONDS)

    way = proposal.branches[2].tool_path.astype(float)
    grip = way[0] + [GRIP_M, GRIP_M, 0.0]
    dragged(page, (grip, grip + MOVED))
    page.wait_for_timeout(SECONDS)
    page.get_by_role("button", name=SIMULATE).click()
    request = served.next_request()
    assert isinstance(request, EditRequest)
    assert (request.proposal_id, request.branch, request.operator) == (proposal.id, 2, "client 0")
    np.testing.assert_allclose(request.start - way[0], MOVED, atol=0.015)
    np.testing.assert_allclose(request.end, way[-1], atol=1e-6)
    expect(page.get_by_text("is being simulated")).to_be_visible()
    expect(page.get_by_role("button", name=SIMULATE)).to_be_disabled()

    served.console.show(synthetic.notice("edit", "The edited motion cannot be offered. It is too long."))
    expect(page.get_by_role("button", name=SIMULATE)).to_be_enabled()
    edited = replace(proposal.branches[2], origin="edited")
    again = replace(synthetic.proposal(synthetic.rope(0.5)), branches=(edited, *proposal.branches), best=0)
    served.console.show(again)
    expect(page.get_by_text("the motion as you changed it")).to_be_visible()
    expect(page.get_by_role("button", name=SIMULATE)).to_be_disabled()
    refusal = replace(synthetic.notice("approval", "The object has moved by 12 mm since."), cause=(again.id,))
    served.console.show(refusal)
    expect(page.locator(".dp-refusal")).to_have_text("The object has moved by 12 mm since.")
