"""The case file in a real browser, opened from disk without any network."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, sync_playwright

from app.report import write_report
from tests.ui.report.cases import CASES, named

pytestmark = pytest.mark.browser


@pytest.fixture
def offline_page(browser_address: str) -> Iterator[Page]:
    """A page that has no network; at its end the test fails where it reported an error or asked for anything."""
    complaints: list[str] = []
    with sync_playwright() as playwright:
        context = playwright.chromium.connect_over_cdp(browser_address).new_context(offline=True)
        page = context.new_page()
        page.on("pageerror", lambda error: complaints.append(f"error: {error}"))
        page.on("console", lambda said: complaints.append(said.text) if said.type in ("error", "warning") else None)
        page.on("request", lambda asked: None if asked.url.startswith("file:") else complaints.append(asked.url))
        yield page
        context.close()
    assert complaints == []


def opened(page: Page, folder: Path, case) -> Page:
    write_report(folder / "report.html", case)
    page.goto((folder / "report.html").as_uri())
    return page


@pytest.mark.parametrize("make", CASES.values(), ids=list(CASES))
def test_the_page_fits_wide_and_narrow_windows(offline_page: Page, tmp_path: Path, make) -> None:
    page = opened(offline_page, tmp_path, make())
    for width in (1280, 400):
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_a_push_is_chosen_on_the_map_and_among_the_examples(offline_page: Page, tmp_path: Path) -> None:
    page = opened(offline_page, tmp_path, named())
    shown = "[...document.querySelectorAll('[data-of={}]:not(.off)')].map(part => part.dataset.key)"
    assert "all" in page.evaluate(shown.format("field"))
    page.select_option("select[data-pick=field]", "7")
    assert page.evaluate(shown.format("field")) == ["7"]
    assert page.evaluate(shown.format("example")) == ["0"]
    page.select_option("select[data-pick=example]", "2")
    assert page.evaluate(shown.format("example")) == ["2"]
