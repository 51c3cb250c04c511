"""The colour sliders: what they follow, what they preview, and what a browser may not make of them."""

from collections.abc import Iterator

import pytest
from viser import ViserServer

from app.core.colours import ColourRange
from app.core.dialogue.requests import Request
from app.ui.parts.operator_controller import OperatorController
from app.ui.server.viser_host import ViserHost
from app.ui.tabs.tuning import Tuning
from tests.ui import synthetic
from tests.ui.test_console_state import state_after

pytestmark = pytest.mark.serial

LEFT = synthetic.frame(synthetic.camera("left", -1.0), synthetic.rope(0.5))
RED = ColourRange(hue_low_deg=340.0, hue_high_deg=20.0, saturation_low=0.4, value_low=0.2)


@pytest.fixture
def server() -> Iterator[ViserServer]:
    viser_host = ViserHost(label="test", passphrase="x")
    yield viser_host.server
    viser_host.close()


@pytest.fixture
def tuning(server: ViserServer) -> Tuning:
    posted: list[Request] = []
    return Tuning(server.gui, OperatorController(stop=lambda: None, post=posted.append))


def test_the_sliders_follow_what_is_in_use_also_through_red(tuning: Tuning):
    assert tuning.paint(state_after()) is None
    assert tuning.paint(state_after(synthetic.seen(LEFT, colour=RED))) is None
    assert tuning.colour_range == RED


def test_what_is_moved_is_previewed_until_it_is_in_use(tuning: Tuning):
    state = state_after(synthetic.seen(LEFT, colour=RED))
    tuning.paint(state)
    tuning._hue.value = (30.0, 340.0)
    wanted = tuning.paint(state)
    assert wanted == ColourRange(hue_low_deg=340.0, hue_high_deg=30.0, saturation_low=0.4, value_low=0.2)
    assert tuning.paint(state.after(synthetic.seen(LEFT, colour=wanted))) is None


@pytest.mark.parametrize("said", [(), (1.0,), (0.1, 0.2, 0.3), (-5.0, 0.5), (0.5, 700.0)])
def test_what_is_no_range_is_neither_previewed_nor_asked_for(tuning: Tuning, said: tuple[float, ...]):
    state = state_after(synthetic.seen(LEFT, colour=RED))
    tuning.paint(state)
    tuning._saturation.value = said
    assert tuning.colour_range is None
    assert tuning.paint(state) is None
