"""Messages that a browser may send: those of viser's page, and no others."""

import math
import time

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.ui.parts.rate_limiter import RateLimiter
from app.ui.server.message_validation import BURST, SPOKEN, STEADY_HZ, refusal
from app.ui.server.viser_host import can_parse

CLICK = {"type": "GuiUpdateMessage", "uuid": "abc", "updates": {"value": True}}
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [0.0, 0.0, 1.0],
    "fov": 1.0,
    "near": 0.01,
    "far": 1000.0,
    "image_height": 900,
    "image_width": 1600,
    "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}
DRAG = {
    "type": "TransformControlsUpdateMessage",
    "name": "/edit/start",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [0.5, -0.2, 0.006],
    "owner": "",
}


GRAB = {"type": "TransformControlsDragStartMessage", "name": "/aim", "owner": ""}
LEAVE = {"type": "TransformControlsDragEndMessage", "name": "/aim"}


def heard(said: object) -> str | None:
    return refusal(msgspec.msgpack.encode(said), can_parse)


SLIDER = CLICK | {"updates": {"value": [12, 354]}}
COLOUR = CLICK | {"updates": {"value": [240, 120, 8]}}


POINTED = {
    "type": "ScenePointerMessage",
    "event_type": "click",
    "ray_origin": [0.5, 0.0, 1.0],
    "ray_direction": [0.0, 0.0, -1.0],
    "screen_pos": [[0.5, 0.5]],
    "modifier": None,
}


@pytest.mark.parametrize("said", [CLICK, CAMERA, DRAG, GRAB, LEAVE, SLIDER, COLOUR, POINTED])
def test_what_the_page_says_is_passed_on(said: dict[str, object]) -> None:
    assert heard(said) is None


@pytest.mark.parametrize("kind", sorted(SPOKEN))
def test_all_that_may_be_said_is_known_to_viser(kind: str) -> None:
    import viser._messages

    assert issubclass(getattr(viser._messages, kind), viser._messages.Message)


@pytest.mark.parametrize(
    "kind", ["ShareUrlRequest", "RunJavascriptMessage", "GuiModalMessage", "os.system", "", 7, None]
)
def test_what_only_a_server_says_or_nobody_is_refused(kind: object) -> None:
    assert heard({"type": kind}) == "no page says such a thing"


@pytest.mark.parametrize("phase", ["Start", "End"])
def test_a_drag_begins_and_ends(phase: str) -> None:
    assert heard({"type": f"TransformControlsDrag{phase}Message", "name": "/edit/end", "owner": ""}) is None


@pytest.mark.parametrize(
    "changed",
    [
        {"name": "/table"},
        {"name": ["/edit/start"]},
        {"owner": "7"},
        {"position": [0.5, 0.0, 1e6]},
        {"position": [0.5, "0", 0.0]},
        {"position": None},
    ],
)
def test_only_the_consoles_handles_are_dragged_and_not_far(changed: dict[str, object]) -> None:
    assert "drags the console's handles" in str(heard(DRAG | changed))
    kind = {"type": "TransformControlsDragStartMessage"}
    if "name" in changed or "owner" in changed:
        assert "drags" in str(heard(kind | {"name": "/edit/start", "owner": ""} | changed))


@pytest.mark.parametrize("drag", [DRAG, GRAB, LEAVE], ids=["drag", "grab", "leave"])
@pytest.mark.parametrize("name", ["/base", "/aim/x", "", "/observed", 7, None, ["/aim"]])
def test_nothing_is_dragged_but_what_can_be(drag: dict[str, object], name: object) -> None:
    assert heard(drag | {"name": name}) == "a browser drags the console's handles over the table and nothing else"


@pytest.mark.parametrize(
    "place", [[], [0.0], [0.0] * 4, ["a", 0.0, 0.0], 7, None, {"x": 0.0}, [[0.0], 0.0, 0.0], [True] * 3]
)
def test_what_is_dragged_is_dragged_to_a_place(place: object) -> None:
    assert heard(DRAG | {"position": place}) == "a browser drags the console's handles over the table and nothing else"
    assert "not finite" in str(heard(DRAG | {"position": [0.5, math.nan, 0.0]}))


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_not_finite_is_refused_wherever_it_stands(number: float) -> None:
    assert "not finite" in str(heard(CLICK | {"updates": {"value": number}}))
    assert "not finite" in str(heard(CLICK | {"updates": {"value": [1.0, {"a": [number]}]}}))
    assert "not finite" in str(heard(CAMERA | {"position": [0.0, number, 1.0]}))


def test_what_is_nested_too_deeply_is_refused() -> None:
    value: object = 1.0
    for _ in range(200):
        value = [value]
    assert "nested" in str(heard(CLICK | {"updates": {"value": value}}))
    assert refusal(b"\x91" * 5000 + b"\x01", can_parse) == "it is no message"


@pytest.mark.parametrize("name", ["update_cb", "removed", "visible", "disabled", "sync_cb", "nonsense", 7])
def test_of_a_widget_only_its_value_is_changed(name: object) -> None:
    assert "changes the value" in str(heard(CLICK | {"updates": {name: []}}))
    assert "changes the value" in str(heard(CLICK | {"updates": {"value": True, name: []}}))


@pytest.mark.parametrize("kind", ["FileTransferStartUpload", "FileTransferPart", "CommandTriggerMessage"])
def test_what_no_widget_of_the_console_asks_for_is_refused(kind: str) -> None:
    assert heard({"type": kind}) == "no page says such a thing"


@pytest.mark.parametrize("much", [[[]] * 20_000, list(range(60_000)), {str(n): n for n in range(5000)}])
def test_a_message_that_takes_long_to_read_is_refused_soon(much: object) -> None:
    began_s = time.process_time()
    assert "too much" in str(heard(CLICK | {"updates": {"value": much}}))
    assert time.process_time() - began_s < 1.0


def test_fields_that_make_no_sense_are_refused() -> None:
    assert heard({"type": "GuiUpdateMessage", "nonsense": 1}) == "its fields make no sense"
    assert heard({"type": "ViewerCameraMessage"}) == "its fields make no sense"


@given(st.binary(max_size=200))
def test_bytes_at_random_are_refused_and_raise_nothing(data: bytes) -> None:
    assert refusal(data, can_parse) is not None


@given(st.recursive(st.none() | st.booleans() | st.integers(0, 9) | st.floats() | st.text(max_size=4), st.lists))
def test_any_value_is_answered(value: object) -> None:
    heard(value)
    heard({"type": "GuiUpdateMessage", "uuid": value, "updates": value})


def test_a_page_that_is_used_never_waits_and_one_that_floods_is_slowed_to_the_steady_pace() -> None:
    pace, now_s = RateLimiter(0.0, steady_hz=STEADY_HZ, burst=BURST), 0.0
    for _ in range(1200):  # Ten seconds of a camera that is turned and a handle that is dragged.
        now_s += 1 / 120
        assert pace.wait_s(now_s) == 0.0
    flood, now_s = RateLimiter(0.0, steady_hz=STEADY_HZ, burst=BURST), 0.0
    for _ in range(2400):
        now_s += flood.wait_s(now_s)
    assert now_s == pytest.approx(2000 / 200, rel=0.05)
