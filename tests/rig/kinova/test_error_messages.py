"""Numbers of the arm in words."""

from app.rig.kinova.api.error_messages import faults, refusal
from app.rig.kinova.api.errors import Refused


def test_every_bit_of_the_banks_is_a_sentence() -> None:
    said = faults(1 << 23 | 1 << 4, (0, 1 << 17, 0, 0, 0, 0, 1 << 5), 1 << 4)
    assert said == (
        "A joint has a fault.",
        "The emergency stop was activated by a program.",
        "Joint 2 has a motor that is too hot; let it cool down.",
        "Joint 7 met too much torque; is something in the way?",
        "The wrist has electronics that are too hot; let them cool down.",
    )
    assert faults(0, (0,) * 7, 0) == ()


def test_a_bit_that_nobody_knows_is_named_by_its_number() -> None:
    assert faults(1 << 31, (1 << 31,), 1 << 31) == (
        "The base has a fault of number 31 that is not known here.",
        "Joint 1 has a fault of number 31 that is not known here.",
        "The wrist has a fault of number 31 that is not known here.",
    )


def test_a_refusal_says_the_call_the_reason_and_what_to_do() -> None:
    error = Refused("SendTwistCommand", 3, 130)
    assert "SendTwistCommand: another session has control" in str(error)
    assert error.sub_code == 130
    assert "number 999" in refusal(999, "x")
