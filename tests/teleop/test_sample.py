"""Samples from a browser: valid ones are read, and all others are refused."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.errors import ParameterError
from app.teleop.sample import Axes, Sample, read_sample

GOOD = {
    "axes": {"x": 1, "y": -0.5, "z": 0, "yaw": 0, "grip": 0},
    "held": True,
    "pressed": 3,
    "sequence": 17,
    "speed": 0.4,
    "frame": "tool",
    "towards": False,
}


def test_what_the_page_says_is_read() -> None:
    assert read_sample(json.dumps(GOOD).encode()) == Sample(
        axes=Axes(x=1.0, y=-0.5), held=True, pressed=3, sequence=17, speed=0.4, frame="tool"
    )


@pytest.mark.parametrize(
    "wrong",
    [
        {"axes": {"x": 1.01}},
        {"axes": {"x": -1e999}},
        {"axes": {"x": "1"}},
        {"axes": {"w": 0}},
        {"axes": [1, 0, 0]},
        {"speed": 1.5},
        {"speed": -0.1},
        {"speed": None},
        {"pressed": -1},
        {"pressed": 2**60},
        {"sequence": 1.5},
        {"sequence": True},
        {"held": 1},
        {"frame": "camera"},
        {"more": 1},
    ],
    ids=str,
)
def test_what_is_out_of_its_range_or_of_another_kind_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ParameterError):
        read_sample(json.dumps(GOOD | wrong).encode())


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e400", "0x1", ""])
@pytest.mark.parametrize("field", ["speed", "x"])
def test_a_number_that_is_none_is_refused(number: str, field: str) -> None:
    text = json.dumps(GOOD).replace('"speed": 0.4' if field == "speed" else '"x": 1', f'"{field}": {number}')
    assert number in text
    with pytest.raises(ParameterError):
        read_sample(text.encode())


@pytest.mark.parametrize("data", [b"", b"{}", b"[]", b"null", b"\xff\xfe", b"[" * 10_000, b'{"axes":' * 5000])
def test_what_is_no_sample_is_refused(data: bytes) -> None:
    with pytest.raises(ParameterError):
        read_sample(data)


@given(st.binary(max_size=300))
def test_bytes_at_random_are_refused(data: bytes) -> None:
    with pytest.raises(ParameterError):
        read_sample(data)
