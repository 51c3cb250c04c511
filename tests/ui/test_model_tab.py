"""The tab about the model in a real browser: two versions compared, one gone back to, a file loaded and one refused."""

from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from app.core.dialogue.requests import ModelRequest
from app.core.messages import Parameter
from app.recording.exchange.model_file import save_model
from tests.ui import synthetic
from tests.ui.conftest import Served
from tests.ui.test_browser import choose, opened
from tests.ui.test_models import version

pytestmark = pytest.mark.browser


@pytest.fixture(autouse=True)
def somewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder in which the program was started; it comes before the console that is served."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_versions_are_compared_gone_back_to_and_loaded_from_files(
    somewhere: Path, served: Served, browser_page: Page
) -> None:
    page = opened(browser_page, served)
    old, new = version(7, 2e4), version(8, 6e4)
    for model in (old, new):
        served.console.show(model)
    page.get_by_text("Model", exact=True).first.click()
    expect(page.get_by_text("Version 8 in use")).to_be_visible()
    choose(page, "Compare with", "version 7")
    expect(page.get_by_text("intervals apart")).to_be_visible()

    choose(page, "Version", "version 7")
    page.get_by_role("button", name="Use this version").click()
    request = served.next_request()
    assert isinstance(request, ModelRequest)
    assert (request.model, request.source, request.operator) == (old, "version 7", "client 0")

    friction = Parameter(name="table_friction", value=0.7, unit="1", low=0.6, high=0.8)
    save_model(somewhere / "mine.toml", replace(synthetic.model(2, 3e-5), parameters=(friction,)))
    box = page.get_by_role("textbox").first
    for named, said in (("none.toml", "'none.toml' is no model of this folder"), ("mine.toml", "mine.toml was read")):
        box.fill(named)
        page.get_by_role("button", name="Load", exact=True).click()
        expect(page.get_by_text(said)).to_be_visible()
    request = served.next_request()
    assert isinstance(request, ModelRequest)
    assert (request.model.parameters, request.source) == ((friction,), "mine.toml")
