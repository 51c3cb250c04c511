"""Messages as bytes: as proto3 writes them, back again, and never anything but one error for bytes that are none."""

import dataclasses
import struct
from types import ModuleType
from typing import Annotated, Any, get_args, get_type_hints

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.rig.kinova.api import feedback, messages, session, setup
from app.rig.kinova.api.errors import WireError
from app.rig.kinova.api.protobuf import Field, decode, encode

MODULES: list[ModuleType] = [feedback, messages, session, setup]
MESSAGES = [
    each
    for module in MODULES
    for each in vars(module).values()
    if dataclasses.is_dataclass(each) and getattr(each, "__module__", "") == module.__name__
]


SIMPLE: dict[str, st.SearchStrategy[Any]] = {
    "uint32": st.integers(0, 0xFFFFFFFF),
    "fixed32": st.integers(0, 0xFFFFFFFF),
    "bool": st.booleans(),
    "string": st.text(max_size=8),
    "bytes": st.binary(max_size=8),
    "float": st.floats(width=32, allow_nan=False, allow_infinity=False),
}
SPOILT = encode(
    feedback.Feedback(
        frame_id=7,
        base=feedback.BaseFeedback(active_state=7, tool_pose_x=0.5, fault_bank_a=1 << 23),
        actuators=(feedback.ActuatorFeedback(position=15.0), feedback.ActuatorFeedback(velocity=1.0)),
        interconnect=feedback.InterconnectFeedback(
            gripper_feedback=feedback.GripperFeedback(motor=(feedback.MotorFeedback(position=50.0),))
        ),
    )
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Sample:
    number: Annotated[int, Field(1, "uint32")] = 0
    text: Annotated[str, Field(2, "string")] = ""
    packed: Annotated[tuple[float, ...], Field(4, "float")] = ()
    many: Annotated[tuple[int, ...], Field(5, "uint32")] = ()
    flag: Annotated[bool, Field(6, "bool")] = False
    word: Annotated[int, Field(7, "fixed32")] = 0
    inner: Annotated[messages.FingerMessage | None, Field(8, "message")] = None


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (Sample(), ""),
        (Sample(number=150), "08 96 01"),  # the example of protobuf.dev/programming-guides/encoding
        (Sample(text="testing"), "12 07 74 65 73 74 69 6e 67"),  # likewise
        (Sample(many=(3, 270, 86942)), "2a 06 03 8e 02 9e a7 05"),  # likewise, its field 6 being 5 here
        (Sample(flag=True, word=1), "30 01 3d 01 00 00 00"),
        (Sample(inner=messages.FingerMessage()), "42 00"),
        (Sample(packed=(1.0, -2.0)), "22 08 00 00 80 3f 00 00 00 c0"),
    ],
)
def test_bytes_are_those_of_the_specification(message: Sample, expected: str) -> None:
    assert encode(message) == bytes.fromhex(expected)
    assert decode(Sample, bytes.fromhex(expected)) == message


def test_numbers_that_repeat_are_read_packed_or_one_by_one() -> None:
    one_by_one = b"".join(b"\x25" + struct.pack("<f", value) for value in (1.0, 2.0))
    assert decode(Sample, one_by_one).packed == (1.0, 2.0)
    assert decode(Sample, encode(Sample(packed=(0.5,))) + one_by_one).packed == (0.5, 1.0, 2.0)


def test_fields_of_a_newer_firmware_are_skipped() -> None:
    newer = bytes.fromhex("f8 07 2a") + bytes.fromhex("fa 07 03 61 62 63") + bytes.fromhex("fd 07 00 00 00 00")
    assert decode(Sample, newer + encode(Sample(number=7))) == Sample(number=7)


def test_a_field_of_another_wire_type_than_expected_is_skipped() -> None:
    assert decode(Sample, bytes.fromhex("0d 01 00 00 00 10 05")) == Sample()


@pytest.mark.parametrize(
    ("data", "says"),
    [
        ("08", "ends within a number"),
        ("08" + "ff" * 11, "more than ten bytes"),
        ("12 05 61", "4 bytes before"),
        ("12 02 ff fe", "UTF-8"),
        ("0b", "wire type 3"),
        ("00 01", "number 0"),
        ("42 02 15 00", "bytes before"),
    ],
)
def test_bytes_that_are_no_message_are_refused_with_the_reason(data: str, says: str) -> None:
    with pytest.raises(WireError, match=says):
        decode(Sample, bytes.fromhex(data))


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e39])
def test_numbers_that_no_arm_should_get_are_not_sent(value: float) -> None:
    with pytest.raises(WireError, match="packed"):
        encode(Sample(packed=(value,)))


@pytest.mark.parametrize("value", [-1, 1 << 32])
def test_numbers_beyond_their_field_are_not_sent(value: int) -> None:
    with pytest.raises(WireError, match="32 bits"):
        encode(Sample(number=value))


@pytest.mark.parametrize("cls", MESSAGES, ids=lambda cls: cls.__name__)
def test_no_two_fields_of_a_message_share_a_number(cls: type[Any]) -> None:
    hints = get_type_hints(cls, include_extras=True)
    numbers = [get_args(hints[each.name])[1].number for each in dataclasses.fields(cls)]
    assert len(set(numbers)) == len(numbers)


def plain(cls: type[Any]) -> st.SearchStrategy[dict[str, Any]]:
    """Contents of any message of this class, with messages as dictionaries."""
    hints = get_type_hints(cls, include_extras=True)
    return st.fixed_dictionaries({name: _values(hint) for name, hint in hints.items()})


def _values(hint: Any) -> st.SearchStrategy[Any]:
    inner, field = get_args(hint)
    repeated = Ellipsis in get_args(inner)
    one = plain(get_args(inner)[0]) if field.kind == "message" else SIMPLE[field.kind]
    if repeated:
        return st.lists(one, max_size=2)
    return st.none() | one if field.kind == "message" else one


def made(cls: type[Any], values: dict[str, Any]) -> Any:
    """Message with these contents."""
    hints, filled = get_type_hints(cls, include_extras=True), dict[str, Any]()
    for name, value in values.items():
        inner = get_args(hints[name])[0]
        if isinstance(value, list):
            each = get_args(inner)[0]
            filled[name] = tuple(made(each, one) if isinstance(one, dict) else one for one in value)
        else:
            filled[name] = made(get_args(inner)[0], value) if isinstance(value, dict) else value
    return cls(**filled)


@settings(max_examples=30)
@given(st.sampled_from([messages.Action, messages.ActionNotification, feedback.Feedback, Sample]), st.data())
def test_what_was_written_is_read_as_it_was(cls: type[Any], data: st.DataObject) -> None:
    message = made(cls, data.draw(plain(cls)))
    assert decode(cls, encode(message)) == message


@given(st.sampled_from(MESSAGES), st.binary(max_size=64))
def test_hostile_bytes_are_a_message_or_one_error(cls: type[Any], data: bytes) -> None:
    try:
        message = decode(cls, data)
    except WireError:
        return
    assert isinstance(message, cls)


@settings(max_examples=50)
@given(st.data())
def test_a_message_cut_or_spoilt_anywhere_is_a_message_or_one_error(data: st.DataObject) -> None:
    spoilt = bytearray(SPOILT)
    for _ in range(data.draw(st.integers(0, 3))):
        spoilt[data.draw(st.integers(0, len(spoilt) - 1))] = data.draw(st.integers(0, 255))
    try:
        decode(feedback.Feedback, bytes(spoilt[: data.draw(st.integers(0, len(spoilt)))]))
    except WireError:
        return
