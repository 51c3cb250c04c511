"""A film is shown as fast as it was taken, on the clock of now; never early, and never old."""

import itertools

import pytest

from app.rig.replayed.pace import CUT_S, LONGEST_S, PlaybackSchedule

RECORDED_S = [7.0, 7.01, 7.5, 7.52, 8.1]


def dues(pace: PlaybackSchedule, recorded_s: list[float], now_s: float) -> list[float]:
    """Times [s] at which the messages are due if each is read as soon as the one before was shown."""
    found = list[float]()
    pace.begin()
    for each in recorded_s:
        found.append(pace.due_s(each, now_s))
        now_s = max(now_s, found[-1])
    return found


def steps(times_s: list[float]) -> list[float]:
    return [after - before for before, after in itertools.pairwise(times_s)]


def test_frames_are_as_far_apart_as_they_were_and_the_first_is_now() -> None:
    found = dues(PlaybackSchedule(), RECORDED_S, 100.0)
    assert found[0] == pytest.approx(100.0)
    assert steps(found) == pytest.approx(steps(RECORDED_S))


def test_the_next_round_begins_a_moment_after_the_end() -> None:
    pace = PlaybackSchedule()
    first = dues(pace, RECORDED_S, 100.0)
    second = dues(pace, RECORDED_S, first[-1])
    assert second[0] == pytest.approx(first[-1] + CUT_S)
    assert steps(second) == pytest.approx(steps(RECORDED_S))


def test_a_time_in_which_nobody_looked_is_cut_short() -> None:
    gap = [7.0, 7.5, 7.5 + 5 * LONGEST_S, 8.0 + 5 * LONGEST_S]
    assert steps(dues(PlaybackSchedule(), gap, 100.0)) == pytest.approx([0.5, CUT_S, 0.5])


def test_a_clock_that_was_set_back_is_a_cut_too() -> None:
    assert steps(dues(PlaybackSchedule(), [7.0, 7.5, 2.0, 2.5], 100.0)) == pytest.approx([0.5, CUT_S, 0.5])


def test_who_is_late_goes_on_from_there_at_the_same_pace() -> None:
    pace = PlaybackSchedule()
    pace.begin()
    assert pace.due_s(7.0, 100.0) == pytest.approx(100.0)
    assert pace.due_s(7.5, 100.6) == pytest.approx(100.5), "a little late is caught up with"
    assert pace.due_s(8.0, 103.0) == pytest.approx(103.0)
    assert pace.due_s(8.5, 103.1) == pytest.approx(103.5)


def test_the_moment_that_is_shown_is_that_of_each_frame_when_it_is_due_and_of_either_side_of_a_cut() -> None:
    pace, now_s = PlaybackSchedule(), 100.0
    for _ in range(2):
        pace.begin()
        for index, recorded_s in enumerate(RECORDED_S):
            due_s = pace.due_s(recorded_s, now_s)
            assert pace.recorded_s(due_s) == pytest.approx(recorded_s)
            # What is read ahead changes nothing about the moment of the frame before.
            assert index == 0 or pace.recorded_s(now_s) == pytest.approx(RECORDED_S[index - 1])
            now_s = due_s
    pace.begin()
    due_s = pace.due_s(RECORDED_S[0], now_s)
    assert pace.recorded_s(now_s + CUT_S * 0.4) == pytest.approx(RECORDED_S[-1] + CUT_S * 0.4)
    assert pace.recorded_s(due_s - CUT_S * 0.4) == pytest.approx(RECORDED_S[0] - CUT_S * 0.4)
