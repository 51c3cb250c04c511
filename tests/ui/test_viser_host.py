"""Messages of a browser that reach viser: values of the kind that their widgets hold."""

from collections.abc import Iterator

import msgspec
import pytest

from app.ui.server.viser_host import ViserHost

pytestmark = pytest.mark.serial


@pytest.fixture(scope="module")
def viser_host() -> Iterator[ViserHost]:
    opened = ViserHost(label="test", passphrase="secret")
    yield opened
    opened.close()


def said(uuid: str, value: object) -> bytes:
    return msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}})


@pytest.mark.parametrize(("value", "taken"), [(3, True), (3.5, True), ("3", False), ([], False), (None, False)])
def test_a_slider_is_told_numbers(viser_host: ViserHost, value: object, taken: bool) -> None:
    slider = viser_host.server.gui.add_slider("Moment", 0, 8, 1, 0)
    assert viser_host.takes(said(slider._impl.uuid, value)) is taken


@pytest.mark.parametrize(("value", "taken"), [([1, 2.5], True), ([1, "x"], False), (1, False), ([[1], [2]], False)])
def test_what_holds_several_numbers_is_told_several(viser_host: ViserHost, value: object, taken: bool) -> None:
    place = viser_host.server.gui.add_vector2("Place", (0.0, 0.0))
    assert viser_host.takes(said(place._impl.uuid, value)) is taken


def test_words_and_widgets_that_are_gone_are_viser_s_own(viser_host: ViserHost) -> None:
    text = viser_host.server.gui.add_text("Reason", "")
    assert viser_host.takes(said(text._impl.uuid, "because"))
    assert viser_host.takes(said("nobody", "because"))
    assert not viser_host.takes(b"nonsense")
