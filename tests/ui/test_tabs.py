"""Tabs about model and cell: the contents of their widgets, at a viser server and without a browser."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from viser import ViserServer

from app.config import Limits
from app.core.dialogue.requests import Request
from app.ui.parts import palette
from app.ui.parts.operator_controller import OperatorController
from app.ui.server.viser_host import ViserHost
from app.ui.tabs.cell import CellTab
from app.ui.tabs.modelling import Versions, label
from app.ui.view.scene import ConsoleScene
from tests.ui import synthetic
from tests.ui.test_console_state import state_after
from tests.ui.test_models import version

pytestmark = pytest.mark.serial

LEFT = synthetic.frame(synthetic.camera("left", -1.0), synthetic.rope(0.5))


@pytest.fixture
def server() -> Iterator[ViserServer]:
    viser_host = ViserHost(label="test", passphrase="x")
    yield viser_host.server
    viser_host.close()


def controller() -> OperatorController:
    posted: list[Request] = []
    return OperatorController(stop=lambda: None, post=posted.append)


def test_the_newest_version_is_chosen_until_somebody_chooses_another(server: ViserServer, tmp_path: Path):
    one, two, three = (version(number, 2e4) for number in (1, 2, 3))
    versions = Versions(server.gui, controller(), tmp_path)
    versions.paint(state_after(one))
    versions.paint(state_after(one, two))
    assert versions._chosen.value == label(two)
    assert versions._use.disabled
    versions._chosen.value = label(one)
    versions.paint(state_after(one, two, three))
    assert versions._chosen.value == label(one)
    assert not versions._use.disabled


def test_a_choice_that_is_not_offered_chooses_nothing(server: ViserServer, tmp_path: Path):
    versions = Versions(server.gui, controller(), tmp_path)
    versions.paint(state_after(version(1, 2e4)))
    versions._chosen.value = versions._other.value = "version 99"
    versions.paint(state_after(version(1, 2e4)))
    assert versions._use.disabled
    assert versions._difference._handle.content == ""


def test_the_picture_is_tinted_previewed_and_plain_as_the_switches_say(server: ViserServer):
    cell = CellTab(server, controller(), ConsoleScene(server, Limits()))
    state = state_after(LEFT, synthetic.seen(LEFT))
    cell.paint(state, LEFT.time_s)
    view = cell._views["left"]
    tinted = view._image.image
    cell._masked.value = False
    cell.paint(state, LEFT.time_s)
    plain = view._image.image
    np.testing.assert_array_equal(plain, LEFT.color[::2, ::2])
    assert 100 < (tinted != plain).any(axis=2).sum() < 5000
    assert "preview" not in view._text._handle.content

    cell._tuning._hue.value = (180.0, 200.0)
    cell._tuning._red.value = False
    cell.paint(state, LEFT.time_s)
    assert "Pixels in preview</td><td><span" in view._text._handle.content


def test_one_camera_is_shown_with_all_its_pixels(server: ViserServer):
    cell = CellTab(server, controller(), ConsoleScene(server, Limits()))
    state = state_after(LEFT, synthetic.seen(LEFT))
    cell.paint(state, LEFT.time_s)
    assert not cell._large._panel.visible
    cell._larger.value = "left"
    cell.paint(state, LEFT.time_s)
    assert cell._large._panel.visible
    assert cell._large._image.image.shape == LEFT.color.shape
    other = replace(LEFT, color=np.zeros_like(LEFT.color))
    cell.paint(state.after(other).after(synthetic.seen(other)), LEFT.time_s)
    assert not cell._large._image.image.any()


def test_what_is_hidden_is_drawn_in_shade_until_it_is_seen_again(server: ViserServer):
    scene, rope = ConsoleScene(server, Limits()), synthetic.rope(0.5)
    hidden = np.arange(len(rope)) < 10
    scene.paint(state_after(replace(synthetic.particles(rope), predicted=hidden)), 0.0)
    colours = np.asarray(scene.observed._handle.batched_colors)
    np.testing.assert_array_equal(colours[:10], np.tile(palette.linear(palette.UNSEEN), (10, 1)))
    np.testing.assert_array_equal(colours[10], palette.linear(palette.OBSERVED))
    scene.paint(state_after(synthetic.particles(rope)), 0.0)
    colours = np.asarray(scene.observed._handle.batched_colors)
    np.testing.assert_array_equal(colours, np.tile(palette.linear(palette.OBSERVED), (len(rope), 1)))
