"""The dead-man's laws: nothing moves without a press that is held, heard and new."""

from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.teleop.deadman import GAP_S, LONGEST_HOLD_S, DeadMan
from app.teleop.sample import Sample

PERIOD_S = 1 / 30


def said(sequence: int, *, pressed: int = 1, held: bool = True) -> Sample:
    return Sample(held=held, pressed=pressed, sequence=sequence, speed=0.5)


def held_for(duration_s: float, man: DeadMan, *, pressed: int = 1, from_s: float = 0.0) -> tuple[DeadMan, float]:
    """After samples at 30 Hz for so long, and when the last came."""
    now_s = from_s
    for _ in range(round(duration_s / PERIOD_S)):
        now_s += PERIOD_S
        man = man.after(said(man.sequence + 1, pressed=pressed), now_s)
    return man, now_s


def test_it_is_off_at_first_and_live_after_a_press() -> None:
    man = DeadMan()
    assert not man.live
    assert man.after(said(0), 5.0).live


def test_a_press_that_is_held_and_heard_stays_live_until_it_is_released() -> None:
    man, now_s = held_for(10.0, DeadMan())
    assert man.live
    man = man.after(said(man.sequence + 1, held=False), now_s + PERIOD_S)
    assert not man.live
    # Held again under the same number is no new press: the page would have counted one.
    assert not man.after(said(man.sequence + 1), now_s + 2 * PERIOD_S).live
    assert man.after(said(man.sequence + 1, pressed=2), now_s + 2 * PERIOD_S).live


def test_a_gap_turns_it_off_until_a_new_press() -> None:
    man, now_s = held_for(1.0, DeadMan())
    assert man.after(said(man.sequence + 1), now_s + GAP_S - 1e-6).live
    man = man.after(said(man.sequence + 1), now_s + GAP_S + 1e-3)
    assert not man.live
    assert "151 ms" in man.why
    assert "press again" in man.why
    man, now_s = held_for(2.0, man, from_s=now_s + 0.2)
    assert not man.live
    assert man.after(said(man.sequence + 1, pressed=2), now_s).live


def test_nobody_holds_it_for_ever() -> None:
    man, now_s = held_for(LONGEST_HOLD_S - 0.5, DeadMan())
    assert man.live
    man, now_s = held_for(1.0, man, from_s=now_s)
    assert not man.live
    assert "30 s" in man.why


def test_turned_off_by_somebody_else_it_wants_a_new_press() -> None:
    man, now_s = held_for(1.0, DeadMan())
    man, now_s = held_for(1.0, man.off("STOP"), from_s=now_s)
    assert (man.live, man.why) == (False, "STOP")
    assert man.after(said(man.sequence + 1, pressed=2), now_s).live


def test_an_old_press_number_is_no_new_press() -> None:
    man, now_s = held_for(1.0, DeadMan(), pressed=7)
    man = man.off("STOP")
    for pressed in range(8):
        assert not man.after(said(man.sequence + 1, pressed=pressed), now_s).live


@pytest.mark.parametrize("late", range(3))
def test_what_is_late_or_comes_twice_changes_nothing(late: int) -> None:
    man = DeadMan().after(said(2), 0.0).off("STOP")
    assert man.after(said(late, pressed=9), 0.01) is man


@dataclass(frozen=True)
class Heard:
    gap_s: float
    sequence: int
    pressed: int
    held: bool


heard = st.builds(
    Heard,
    gap_s=st.floats(0.0, 0.3) | st.just(PERIOD_S) | st.floats(0.0, 40.0),
    sequence=st.integers(0, 40),
    pressed=st.integers(0, 5),
    held=st.booleans() | st.just(True),
)


@given(st.lists(heard, max_size=60))
def test_whatever_is_heard_live_means_a_new_press_and_no_gap_since(told: list[Heard]) -> None:
    man, now_s = DeadMan(), 0.0
    for each in told:
        now_s += each.gap_s
        before, man = man, man.after(said(each.sequence, pressed=each.pressed, held=each.held), now_s)
        in_order, new = each.sequence > before.sequence, each.pressed > before.pressed
        if man is before:
            assert not in_order
            continue
        assert man.live == (each.held and (new or (before.live and now_s - before.heard_s <= GAP_S and man.live)))
        if man.live and not new:
            assert before.live
            assert now_s - before.heard_s <= GAP_S
            assert now_s - man.since_s <= LONGEST_HOLD_S


@given(st.lists(heard, max_size=60), st.floats(GAP_S + 1e-6, 10.0))
def test_no_sequence_with_a_gap_moves_on_without_a_new_press(told: list[Heard], gap_s: float) -> None:
    man = DeadMan().after(said(0, pressed=6), 0.0)
    now_s = gap_s
    for each in told:
        man = man.after(said(man.sequence + 1, pressed=each.pressed, held=each.held), now_s)
        assert not man.live
        now_s += each.gap_s
