"""The door opens to the token on a loopback name, from our own page."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.ui.server.access import Access

ACCESS = Access(token="right", cookie="dipac_1")


def refusal(*, host="127.0.0.1:1", origin=None, cookie="right", acts=False):
    return ACCESS.refusal(host=host, origin=origin, cookie=cookie, acts=acts)


@pytest.mark.parametrize("host", ["127.0.0.1:1", "localhost:1", "[::1]:1", "localhost:9000", "LOCALHOST"])
def test_loopback_names_are_admitted_on_any_port_as_through_a_tunnel(host):
    assert refusal(host=host) is None
    assert refusal(host=host, origin=f"http://{host}", acts=True) is None


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "evil.example:8088", "", "[", "10.0.0.1"])
def test_another_name_that_leads_here_is_refused(host):
    assert refusal(host=host) is not None


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "null", "http://127.0.0.1:2", "http://localhost:1", "", "file://", "http://[", "http://"],
)
def test_another_page_is_refused_whether_it_acts_or_looks(origin):
    assert refusal(origin=origin, acts=True) is not None
    assert refusal(origin=origin, acts=False) is not None


def test_an_act_without_an_origin_is_refused_and_a_look_is_not():
    assert refusal(acts=True) is not None
    assert refusal(acts=False) is None


@given(st.one_of(st.none(), st.text().filter(lambda text: text != "right")))
def test_no_other_token_opens(cookie):
    assert refusal(cookie=cookie) is not None


def test_a_cookie_that_is_no_text_opens_nothing_and_raises_nothing():
    assert refusal(cookie=b"\xff\xfe".decode("utf-8", "surrogateescape")) is not None


def test_the_token_does_not_show_in_a_traceback():
    assert "right" not in repr(ACCESS)
