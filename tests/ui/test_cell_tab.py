"""The tab about the cell in a real browser: masks counted, colours tuned and used, clouds switched on."""

import pytest
from playwright.sync_api import Page, expect

from app.core.colours import ColourRange
from app.core.dialogue.requests import ColourRequest
from tests.ui import synthetic
from tests.ui.conftest import Served
from tests.ui.test_browser import choose, opened

pytestmark = pytest.mark.browser


def test_colours_are_previewed_used_and_undone_and_clouds_are_drawn(served: Served, browser_page: Page) -> None:
    page = opened(browser_page, served)
    page.set_viewport_size({"width": 1600, "height": 1500})
    frames = [
        synthetic.frame(synthetic.camera(name, turn), synthetic.rope(0.5))
        for name, turn in (("left", -1.0), ("right", 1.0))
    ]
    seen = synthetic.seen(*frames)
    for message in (*frames, seen):
        served.console.show(message)
    count = f"{seen.pixels['left']:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")
    expect(page.get_by_text(count, exact=True)).to_be_visible()

    page.get_by_text("Colours of the object").click()
    expect(page.get_by_text("In use: hue 7", exact=False)).to_be_visible()
    thumb = page.locator(".multi-slider").first.locator(".multi-slider-thumb").nth(1)
    box = thumb.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 60, y, steps=6)
    page.mouse.up()
    expect(page.get_by_text("Nothing has changed yet")).to_be_visible()
    expect(page.get_by_text("Pixels in preview")).to_have_count(2)

    page.get_by_role("button", name="Use these colours").click()
    request = served.next_request()
    assert isinstance(request, ColourRequest)
    assert request.operator == "client 0"
    assert request.hue_deg[0] == round(synthetic.COLOUR.hue_low_deg)
    assert request.hue_deg[1] > synthetic.COLOUR.hue_high_deg + 30
    used = ColourRange.of(request.hue_deg, request.saturation, request.value)
    served.console.show(synthetic.seen(*frames, colour=used))
    expect(page.get_by_text("Pixels in preview")).to_have_count(0)

    page.get_by_role("button", name="Undo").click()
    request = served.next_request()
    assert isinstance(request, ColourRequest)
    assert request.hue_deg == synthetic.COLOUR.hue_deg

    expect(page.get_by_text("No clouds are drawn.")).to_be_visible()
    choose(page, "Of the cameras", "by camera")
    expect(page.get_by_text("left: ", exact=False)).to_be_visible()
    choose(page, "Larger", "right")
    expect(page.get_by_text("Camera", exact=True)).to_be_visible()
