"""The tab that describes the object: what it shows, what it writes, and in a browser what is pressed for it."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect
from viser import ViserServer

from app.core.dialogue.object_messages import MeasuredObject, MeasuredSize
from app.core.dialogue.requests import DemonstrationRequest, HandRequest, MeasureRequest, StartPoseRequest
from app.core.errors import ParameterError, UsageError
from app.core.geometry.object_description import ObjectType
from app.core.messages import Parameter, fresh_id
from app.recording.exchange.object_file import load_object, save_object
from app.ui.parts.console_state import ConsoleState
from app.ui.server.viser_host import ViserHost
from app.ui.tabs.by_hand import GIVE, START, TAKE
from app.ui.tabs.demonstrations import AGAIN
from app.ui.tabs.object_wizard import MEASURE, SAVE, ObjectTab, _path
from app.ui.view.measured import card
from tests.ui.conftest import Served
from tests.ui.test_asking import mode
from tests.ui.test_browser import opened
from tests.ui.test_models import version
from tests.ui.test_operator_controller import Program

FOUND = MeasuredObject(
    id=fresh_id("measured"),
    time_s=1.0,
    kind="rope",
    views=8,
    sizes=(
        MeasuredSize(name="length_m", value=0.412, sd=0.007),
        MeasuredSize(name="radius_m", value=0.0077, sd=0.0005),
        MeasuredSize(name="mass_kg", value=0.06, sd=0.0, seen=False),
    ),
    colour=(0.7, 0.2, 0.1),
    hue_deg=(350.0, 20.0),
    saturation=(0.7, 1.0),
    value=(0.2, 1.0),
    notes=("Its mass is not seen: weigh it.",),
)


@pytest.fixture
def server() -> Iterator[ViserServer]:
    viser_host = ViserHost(label="test", passphrase="x")
    yield viser_host.server
    viser_host.close()


def field(page: Page, label: str) -> Locator:
    """The text field beside a label, which viser's page does not join for programs."""
    return page.get_by_text(label, exact=True).locator("xpath=ancestor::*[.//input][1]").locator("input")


def test_what_was_measured_is_shown_with_its_errors_and_what_was_not_as_assumed() -> None:
    said = card(FOUND)
    for text in ("412 mm \N{PLUS-MINUS SIGN} 7 mm", "7.7 mm", "60.0 g, assumed", "weigh it", "350 to 20 degrees"):
        assert text in said
    assert "measure it" in card(None)
    beans = replace(FOUND, kind="beans", sizes=(MeasuredSize(name="piece_length_m", value=0.016, sd=0.0015),))
    assert "Length of one" in card(beans)
    assert "<b>" not in card(replace(FOUND, notes=("<b>x",)))[len("<div class='dp'><b>") :].replace("<b>Rope", "")


@pytest.mark.serial
def test_fields_follow_a_measurement_are_corrected_and_saved_as_a_file_that_is_read(
    server: ViserServer, tmp_path: Path
) -> None:
    program = Program()
    tab = ObjectTab(server.gui, program.controller, tmp_path)
    assert not tab._save.visible
    learned = version(3, 2e4)
    known = Parameter(name="table_friction", unit="1", value=0.3, low=0.2, high=0.5)
    learned = replace(learned, parameters=(known, replace(known, name="adhesion")))
    tab.paint(replace(ConsoleState(), measured=FOUND, model=learned))
    assert {name: field.value for name, field in tab._fields.items()} == {
        "length_m": 412.0,
        "radius_m": 7.7,
        "mass_kg": 60.0,
    }
    tab._fields["mass_kg"].value = 55.5
    tab._name.value, tab._learned.value = "climbing cord", True
    description = tab._description()
    save_object(tmp_path / "object.toml", description)
    read = load_object(tmp_path / "object.toml")
    assert read == description
    assert (read.kind, read.name, read.sizes["mass_kg"]) == ("rope", "climbing cord", 0.0555)
    assert read.seen_colours == FOUND.colours
    assert read.priors == (known,), "effects are none of what is known of an object"
    tab._seen.value = tab._learned.value = False
    assert tab._description().colours is None
    assert tab._description().priors == ()
    # Another kind has other fields.
    sizes = (MeasuredSize(name="count", value=30.0, sd=9.0),)
    tab.paint(replace(ConsoleState(), measured=replace(FOUND, kind="beans", sizes=sizes)))
    assert (set(tab._fields), tab._fields["count"].value) == ({"count", "mass_kg"}, 30.0)


@pytest.mark.serial
@pytest.mark.parametrize(
    ("kind", "size", "shown", "said", "corrected"),
    [
        ("rope", MeasuredSize(name="length_m", value=0.9, sd=0.007), 900.0, "Length [mm] 900 (it simulates 180", 780.0),
        (
            "beans",
            MeasuredSize(name="count", value=95.0, sd=3.0),
            95.0,
            "Number of pieces 95 (it simulates 20 to",
            80.0,
        ),
    ],
)
def test_a_size_that_cannot_be_simulated_is_shown_as_measured_and_not_saved_until_it_is_corrected(
    kind: ObjectType,
    size: MeasuredSize,
    shown: float,
    said: str,
    corrected: float,
    server: ViserServer,
    tmp_path: Path,
) -> None:
    program = Program()
    tab = ObjectTab(server.gui, program.controller, tmp_path)
    tab.paint(replace(ConsoleState(), measured=replace(FOUND, kind=kind, sizes=(size,))))
    field = tab._fields[size.name]
    assert field.value == shown
    assert said in tab._said._handle.content
    tab._fields["mass_kg"].value = 50.0
    with pytest.raises(ParameterError, match=r"Outside of what the task can simulate.*by hand") as refused:
        tab._save_to("object.toml")
    assert said in str(refused.value)
    assert list(tmp_path.iterdir()) == []
    field.value = corrected
    tab._save_to("object.toml")
    read = load_object(tmp_path / "object.toml")
    assert read.sizes[size.name] == pytest.approx(corrected * size.value / shown)
    # A measurement within the range says nothing of it.
    tab.paint(replace(ConsoleState(), measured=replace(FOUND, id=fresh_id("measured"))))
    assert "simulate" not in tab._said._handle.content


@pytest.mark.parametrize(
    "named",
    ["../object.toml", "a/b.toml", "/etc/object.toml", "object.txt", "", ".toml/x", f"{300 * 'a'}.toml", "\udc80.toml"],
)
def test_files_are_written_into_the_programs_folder_alone(named: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no name for it"):
        _path(tmp_path, named)
    assert _path(tmp_path, " mine.toml ") == tmp_path / "mine.toml"
    (tmp_path / "link.toml").symlink_to(tmp_path / "other.toml")
    with pytest.raises(UsageError, match="no name for it"):
        _path(tmp_path, "link.toml")


def test_whoever_takes_over_stops_the_arm_first_and_asks_for_it_after_that() -> None:
    program = Program()
    program.controller.take_over("ann")
    asked = program.requests[0]
    assert program.heard.index("arm stopped") < program.heard.index(asked)
    assert isinstance(asked, HandRequest)
    assert (asked.act, asked.operator) == ("take", "ann")
    # Who has no control stops the arm by STOP alone.
    program.controller.take_over("bob")
    assert program.heard.count("arm stopped") == 1
    assert "bob has no control" in program.said[-1]


@pytest.mark.browser
def test_the_object_is_measured_and_saved_and_the_arm_is_asked_for_in_a_browser(
    served: Served, browser_page: Page
) -> None:
    page = opened(browser_page, served)
    page.get_by_role("tab", name="Object").click()
    page.get_by_role("button", name=MEASURE).click()
    assert isinstance(served.next_request(), MeasureRequest)
    served.console.show(replace(FOUND, id=fresh_id("measured")))
    expect(page.get_by_text("412 mm")).to_be_visible()
    field(page, "File").fill("../mine.toml")
    page.get_by_role("button", name=SAVE).click()
    expect(page.get_by_text("Not saved.")).to_be_visible()
    page.get_by_role("button", name=START).click()
    assert isinstance(served.next_request(), StartPoseRequest)
    page.get_by_role("button", name=TAKE).click()
    asked = served.next_request()
    assert isinstance(asked, HandRequest)
    served.console.show(mode("teleoperate"))
    page.get_by_role("button", name=GIVE).click()
    asked = served.next_request()
    assert isinstance(asked, HandRequest)
    assert asked.act == "give"
    page.get_by_text("Demonstrations", exact=True).click()
    field(page, "File to make again").fill("shown.mcap")
    page.get_by_role("button", name=AGAIN).click()
    asked = served.next_request()
    assert isinstance(asked, DemonstrationRequest)
    assert asked.recording == "shown.mcap"
