"""Modes, goals and demonstrations in a real browser: what is pressed is what is asked for."""

import re
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page, expect

from app.core.dialogue.checklist import CheckedBy, CheckItem, Checklist, ChecklistRequest
from app.core.dialogue.control import EndRequest, Lease, Mode, ModeRequest
from app.core.dialogue.demonstration_messages import Take
from app.core.dialogue.requests import ClipRequest, GoalRequest, PictureGoalRequest, ProbeRequest, TakeRequest
from app.core.messages import Fault, Notice, fresh_id
from tests.ui import synthetic
from tests.ui.conftest import Served
from tests.ui.test_browser import APPROVE, choose, opened, wait_until

pytestmark = pytest.mark.browser


def button(page: Page, name: str) -> None:
    page.get_by_role("button", name=name, exact=True).click()


def mode(name: str, motions: int = 0) -> Mode:
    return Mode(id=fresh_id("mode"), time_s=time.monotonic(), mode=name, motions=motions)


def draw_a_bent_copy(page: Page) -> None:
    choose(page, "Draw", "A moved copy of the object")
    page.get_by_role("slider").first.focus()
    page.keyboard.press("End")
    page.keyboard.press("ArrowLeft")
    expect(page.get_by_text("From what is drawn")).to_be_visible()
    wait_until(lambda: "0.0 mm" not in page.get_by_text("From what is drawn").inner_text())


def test_the_mode_is_always_in_view_and_each_is_one_press_away(served: Served, browser_page: Page) -> None:
    page = opened(browser_page, served)
    bar = page.locator("#dp-mode-now")
    for said, asked in (("Idle", "idle"), ("By hand", "teleoperate"), ("Plan only", "plan only")):
        button(page, said)
        request = served.next_request()
        assert isinstance(request, ModeRequest)
        assert (request.mode, request.operator) == (asked, "client 0")
        served.console.show(mode(asked))
        expect(bar).to_have_text(said)
        expect(page.get_by_role("button", name=APPROVE)).to_be_disabled()

    page.get_by_role("textbox", name="Motions").fill("7")
    button(page, "Make 7 motions automatically")
    request = served.next_request()
    assert isinstance(request, ModeRequest)
    assert (request.mode, request.motions) == ("automatic", 7)
    served.console.show(mode("automatic", 7))
    expect(bar).to_have_text("Automatic: 7 motions more")
    served.console.show(mode("approve each"))
    expect(page.get_by_role("button", name=APPROVE)).to_be_enabled()
    served.console.show(
        Fault(id=fresh_id("fault"), time_s=time.monotonic(), where="arm", text="Its process ended.", fatal=True)
    )
    expect(bar).to_have_text("Fault")


def checklist(**right: bool) -> Checklist:
    """Checklist of two items that the program sees, and two that a person confirms."""
    told: dict[str, CheckedBy] = {"arm": "program", "stop": "program", "emergency": "operator", "limits": "operator"}
    items = tuple(
        CheckItem(key=key, text=f"About {key}.", by=by, right=right.get(key, False), said=f"why {key} is so")
        for key, by in told.items()
    )
    passed = all(item.right for item in items)
    return Checklist(id=fresh_id("checklist"), time_s=time.monotonic(), items=items, passed=passed)


def test_before_a_checklist_is_complete_nothing_is_approved_and_each_thing_is_confirmed_by_its_button(
    served: Served, browser_page: Page
) -> None:
    page = opened(browser_page, served)
    served.console.show(checklist(arm=True))
    expect(page.get_by_text("The checklist comes first")).to_be_visible()
    expect(page.get_by_text("why stop is so")).to_be_visible()
    expect(page.get_by_role("button", name=APPROVE)).to_be_disabled()
    button(page, "I tried the emergency stop")
    request = served.next_request()
    assert isinstance(request, ChecklistRequest)
    assert (request.key, request.operator) == ("emergency", "client 0")
    served.console.show(checklist(arm=True, stop=True, emergency=True))
    expect(page.get_by_role("button", name="I tried the emergency stop")).to_be_hidden()
    expect(page.get_by_role("button", name="The limits fit the cell")).to_be_visible()
    served.console.show(checklist(arm=True, stop=True, emergency=True, limits=True))
    expect(page.get_by_text("Before the first motion")).to_be_hidden()
    expect(page.get_by_role("button", name=APPROVE)).to_be_enabled()


def test_on_a_real_arm_motions_without_approval_are_asked_for_twice(served: Served, browser_page: Page) -> None:
    page = opened(browser_page, served)
    served.console.show(replace(synthetic.episode(), simulated=False))
    served.console.show(mode("approve each"))
    sure = page.get_by_role("button", name=re.compile("on the REAL arm, without approval"))
    button(page, "Make 3 motions automatically")
    notice = served.next_request()
    assert isinstance(notice, Notice)
    assert "client 0 has no control" in notice.text
    button(page, "Take")
    expect(page.get_by_text("client 0 has control")).to_be_visible()
    page.get_by_role("textbox", name="Motions").fill("5")
    button(page, "Make 5 motions automatically")
    expect(sure).to_have_text("Yes: 5 motions on the REAL arm, without approval")
    page.get_by_role("textbox", name="Motions").fill("50")
    expect(page.get_by_role("button", name="Make 50 motions automatically")).to_be_visible()
    sure.click()
    request = served.next_request()
    assert isinstance(request, ModeRequest)
    assert (request.mode, request.motions, request.confirmed) == ("automatic", 5, True)
    expect(sure).to_be_hidden()


def test_nobody_else_confirms_what_somebody_was_asked(served: Served, new_page: Callable[[], Page]) -> None:
    page = opened(new_page(), served)
    served.console.show(replace(synthetic.episode(), simulated=False))
    button(page, "Take")
    expect(page.get_by_text("client 0 has control")).to_be_visible()
    button(page, "Make 3 motions automatically")
    sure = re.compile("Yes: 3 motions on the REAL arm")
    watcher = new_page()
    watcher.goto(served.console.url)
    watcher.get_by_role("button", name=sure).click()
    watcher.wait_for_timeout(500)
    expect(page.get_by_role("button", name=sure)).to_be_visible()
    button(page, "Release")
    expect(page.get_by_role("button", name=sure)).to_be_hidden()
    assert {type(request) for request in served.requests} == {Lease}


def test_the_session_ends_once_that_is_said_twice(served: Served, browser_page: Page) -> None:
    page = opened(browser_page, served)
    page.get_by_text("View", exact=True).click()
    expect(page.get_by_role("button", name="End it now")).to_be_hidden()
    page.get_by_text("End the session").click()
    button(page, "End it now")
    assert isinstance(served.next_request(), EndRequest)


def test_goals_are_the_view_a_bent_copy_a_region_and_a_curve(served: Served, browser_page: Page) -> None:
    page, object_ = opened(browser_page, served), synthetic.rope(0.5)
    page.get_by_text("Goal", exact=True).click()
    expect(page.get_by_text("from the goal")).to_be_visible()
    button(page, "Current view as goal")
    request = served.next_request()
    assert isinstance(request, GoalRequest)
    assert request.source == "view"
    np.testing.assert_array_equal(request.positions, object_)

    draw_a_bent_copy(page)
    button(page, "Use as goal")
    request = served.next_request()
    assert isinstance(request, GoalRequest)
    assert request.source == "copy"
    np.testing.assert_allclose(request.positions[:, :2].mean(0), object_[:, :2].mean(0), atol=1e-3)
    assert np.abs(request.positions - object_).max() > 0.01
    expect(page.get_by_role("button", name="Use as goal")).to_be_hidden()

    choose(page, "Draw", "A region that it fills")
    button(page, "Use as goal")
    request = served.next_request()
    assert isinstance(request, GoalRequest)
    away = np.linalg.norm(request.positions[:, :2] - object_[:, :2].mean(0), axis=1)
    assert request.source == "region"
    assert away.max() == pytest.approx(0.08, abs=0.002)

    choose(page, "Draw", "A curve that it follows")
    expect(page.get_by_text("Click on the table")).to_be_visible()
    for x, y in ((650, 420), (750, 480), (850, 430), (950, 500)):
        page.mouse.click(x, y)
        page.wait_for_timeout(300)
    button(page, "Use as goal")
    request = served.next_request()
    assert isinstance(request, GoalRequest)
    assert request.source == "curve"
    assert request.positions.shape == object_.shape
    np.testing.assert_array_equal(request.positions[:, 2], object_[:, 2])


def test_a_goal_that_is_refused_for_want_of_control_stays_drawn(served: Served, new_page: Callable[[], Page]) -> None:
    page, object_, other = opened(new_page(), served), synthetic.rope(0.5), new_page()
    other.goto(served.console.url)
    button(other, "Take")
    expect(page.get_by_text("client 1 has control")).to_be_visible()
    page.get_by_text("Goal", exact=True).click()
    draw_a_bent_copy(page)
    button(page, "Use as goal")
    notice = served.next_request()
    assert isinstance(notice, Notice)
    assert notice.text == "client 0 has no control; client 1 has. Take it first."
    button(other, "Release")
    button(page, "Take")
    expect(page.get_by_text("client 0 has control")).to_be_visible()
    button(page, "Use as goal")
    request = served.next_request()
    assert isinstance(request, GoalRequest)
    assert request.source == "copy"
    assert np.abs(request.positions - object_).max() > 0.01
    expect(page.get_by_role("button", name="Use as goal")).to_be_hidden()


def test_files_are_goals_once_they_are_chosen(served: Served, browser_page: Page, tmp_path: Path) -> None:
    page, points = opened(browser_page, served), synthetic.rope(0.2)
    page.get_by_text("Goal", exact=True).click()
    np.save(tmp_path / "goal.npy", points)
    chooser = page.get_by_label("Goal of a file")
    chooser.set_input_files(tmp_path / "goal.npy")
    request = served.next_request()
    assert isinstance(request, GoalRequest)
    assert (request.source, request.operator) == ("file", "client 0")
    np.testing.assert_array_equal(request.positions, points)
    expect(page.get_by_text("Sent; the messages say what came of it.")).to_be_visible()

    color = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)
    depth = np.full((48, 64), 700, np.uint16)
    Image.fromarray(color).save(tmp_path / "color.png")
    Image.fromarray(depth).save(tmp_path / "depth.png")
    page.get_by_label("Camera of the pictures").select_option("right")
    chooser.set_input_files([tmp_path / "color.png", tmp_path / "depth.png"])
    request = served.next_request()
    assert isinstance(request, PictureGoalRequest)
    assert request.camera == "right"
    np.testing.assert_array_equal(request.color, color)
    np.testing.assert_array_equal(request.depth, depth)

    (tmp_path / "notes.txt").write_text("not a goal")
    chooser.set_input_files(tmp_path / "notes.txt")
    expect(page.get_by_text("give one .npy, .npz or .ply file")).to_be_visible()


def test_demonstrations_are_begun_ended_and_counted(served: Served, browser_page: Page) -> None:
    page = opened(browser_page, served)

    def show(state: str, transitions: int = 0, succeeded: int = 0) -> None:
        taken = {"number": 1, "path": "demo.mcap", "transitions": transitions, "succeeded": succeeded}
        served.console.show(Take(id=fresh_id("take"), time_s=time.monotonic(), state=state, **taken))

    page.get_by_text("Demonstrations", exact=True).click()
    button(page, "Start a demonstration")
    show("recording")
    asked = [served.next_request()]
    expect(page.get_by_text("Recording number 1")).to_be_visible()
    show("recording", transitions=2)
    expect(page.get_by_text("2 motions so far")).to_be_visible()
    for act in ("Redo", "Discard", "Failure", "Success"):
        button(page, act)
        asked.append(served.next_request())
    assert all(isinstance(request, TakeRequest) for request in asked)
    assert [request.act for request in asked] == ["start", "redo", "discard", "failure", "success"]
    show("success", transitions=2, succeeded=1)
    expect(page.get_by_text("1 of 10 succeeded")).to_be_visible()
    expect(page.get_by_role("button", name="Start a demonstration")).to_be_visible()
    button(page, "Save the last 30 seconds")
    clip = served.next_request()
    assert isinstance(clip, ClipRequest)
    assert clip.duration_s == 30.0


def test_an_experiment_of_so_many_pushes_is_begun_and_ended(served: Served, browser_page: Page) -> None:
    page = opened(browser_page, served)
    page.get_by_role("tab", name="Discovery").click()
    button(page, "Find out what the model lacks")
    begun = served.next_request()
    assert isinstance(begun, ProbeRequest)
    assert begun.pushes == 24
    button(page, "Plan for the goal again")
    ended = served.next_request()
    assert isinstance(ended, ProbeRequest)
    assert ended.pushes == 0
