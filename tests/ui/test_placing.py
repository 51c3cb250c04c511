"""The calibration tab: what it says, without a browser; and in one, what is asked and shown."""

from datetime import date

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from app.core.dialogue.camera_calibration_messages import BoardSeen, Checked, Placed, Placing, TakenView
from app.core.dialogue.requests import CalibrationRequest
from app.core.geometry.hand_eye import Spread
from app.core.messages import fresh_id
from app.ui.parts import palette
from app.ui.parts.console_state import ConsoleState
from app.ui.placing import cards
from tests.ui import synthetic
from tests.ui.conftest import Served
from tests.ui.test_browser import choose, opened

TODAY = date(2026, 11, 23)


def view(error_px: float = 0.3, *, outlier: bool = False) -> TakenView:
    return TakenView(tilt_deg=(10.0, -5.0), error_px=error_px, error_m=4e-4, error_deg=0.05, outlier=outlier)


def placing(**fields) -> Placing:
    given = {
        "camera": "camera0",
        "under_way": True,
        "views": (view(), view(9.0, outlier=True)),
        "spread": (Spread(turns_deg=(21.0, 6.0, 2.0), shifts_m=(0.08, 0.04, 0.01)),),
        "placed": (
            Placed(
                pose=np.eye(4),
                deviation_m=(3e-4, 2e-4, 1e-4),
                deviation_deg=(0.02, 0.03, 0.01),
                error_px=0.4,
                moved_m=0.0053,
                turned_deg=0.4,
            ),
        ),
        "next_pose": np.array([[0.5, 0.1, 0.3, 0.0, 1.0, 0.0, 0.0]]),
        "promised_m": 2e-4,
        "said": "The camera is placed.",
    }
    return Placing(id=fresh_id("placing"), time_s=1.0, **(given | fields))


def seen(corners: int = 24, why: str = "") -> BoardSeen:
    pixels = np.tile(np.array([[20.0, 10.0]], np.float32), (corners, 1))
    return BoardSeen(
        id=fresh_id("board"), time_s=1.0, camera="camera0", corners=pixels, error_px=0.12, distance_m=0.51, why=why
    )


def test_the_result_has_every_number_and_marks_what_is_not_enough() -> None:
    said = cards.result(
        placing(kept_at="2026-10-01", checked=(Checked(moved_m=5e-3, turned_deg=0.1, beyond=True),)), TODAY
    )
    for words in ("0.30 px, 0.40 mm, 0.05°", "left out", "21°", "5.3 mm, 0.40°", "0.30 mm, 0.030°", "500, 100, 300 mm"):
        assert words in said
    assert "stale: check it" in said
    assert said.count("<circle") == 2
    assert "5.0 mm, 0.10°" in said
    assert "dp-bad" in said


def test_before_there_is_a_result_nothing_is_made_up() -> None:
    said = cards.result(placing(views=(view(float("nan")),), placed=(), next_pose=np.zeros((0, 7))), TODAY)
    assert "nan" not in said
    assert "Result" not in said
    assert cards.result(None, TODAY) == ""
    assert "never kept" in said


def test_what_the_camera_sees_is_said_and_drawn() -> None:
    state = ConsoleState().after(placing()).after(seen())
    assert "24 corners at 0.51 m" in cards.live(state)
    assert "not in the image" in cards.live(state.after(seen(0, "The state is not in the image.")))
    image = np.zeros((480, 640, 3), np.uint8)
    painted = cards.mark(image, seen())
    assert painted.shape == (240, 320, 3)
    assert tuple(painted[5, 10]) == palette.MASK
    assert not image.any()


def test_no_words_from_outside_become_markup() -> None:
    hostile = "<img src=x onerror=alert(1)>"
    state = ConsoleState().after(placing(said=hostile, camera=hostile, kept_at=hostile)).after(seen(0, hostile))
    assert "<img" not in cards.live(state)
    assert "<img" not in cards.result(state.placing, TODAY)


@pytest.mark.browser
def test_a_camera_is_calibrated_step_by_step_in_the_browser(served: Served, browser_page: Page) -> None:
    page = opened(browser_page, served)
    for name in ("camera0", "camera1"):
        served.console.show(synthetic.frame(synthetic.camera(name, 1.0), synthetic.rope(0.5)))
    page.get_by_text("Calibrate", exact=True).first.click()
    choose(page, "Camera", "camera0")
    page.get_by_role("button", name="Begin").click()
    begun = served.next_request()
    assert isinstance(begun, CalibrationRequest)
    assert (begun.act, begun.camera) == ("begin", "camera0")
    assert (begun.square_m, begun.marker_m) == pytest.approx((0.036, 0.024))

    served.console.show(placing(views=(), spread=(), placed=(), next_pose=np.zeros((0, 7)), said="Take a view now."))
    served.console.show(seen())
    expect(page.get_by_text("Take a view now.")).to_be_visible()
    expect(page.get_by_text("24 corners at 0.51 m")).to_be_visible()
    for label, act in (("Take a view", "take"), ("Remove the last", "drop"), ("Check", "check"), ("Keep", "save")):
        page.get_by_role("button", name=label, exact=True).click()
        asked = served.next_request()
        assert isinstance(asked, CalibrationRequest)
        assert (asked.act, asked.camera, asked.operator) == (act, "camera0", "client 0")

    served.console.show(placing())
    expect(page.get_by_text("5.3 mm, 0.40°")).to_be_visible()
    expect(page.get_by_text("500, 100, 300 mm")).to_be_visible()
    served.console.show(placing(under_way=False))
    expect(page.get_by_role("button", name="Take a view", exact=True)).not_to_be_visible()
