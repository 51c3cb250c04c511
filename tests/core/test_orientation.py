"""Belief about a rope's ends: learnt from which way round predicts better, and kept as the rope is followed."""

import math
import pickle

import numpy as np
import pytest

from app.core.geometry.orientation import SURE, UNKNOWN, Orientation
from app.core.types import Centreline

NODES = 33


def line(turn_rad: float = 0.0, aside_m: float = 0.0) -> Centreline:
    """A straight rope of 0.4 m about the middle of the table."""
    along = np.linspace(-0.2, 0.2, NODES)
    places = np.stack([0.55 + along * np.cos(turn_rad), aside_m + along * np.sin(turn_rad)])
    return places.astype(np.float32)


def sure() -> Orientation:
    """A belief that is sure that the first node is the first end."""
    known = UNKNOWN
    for _ in range(3):
        known = pushed(known, 0.001, 0.02)
    return known


def errors(after: Centreline, first_m: float, last_m: float) -> np.ndarray:
    """Predictions with these errors: one if the first node is the first end, one if the last node is."""
    up = np.array([[0.0], [1.0]], np.float32)
    return np.stack([after + first_m * up, after + last_m * up])


def pushed(known: Orientation, first_m: float, last_m: float) -> Orientation:
    return known.observe(line(), errors(line(), first_m, last_m), line())


def test_nothing_is_known_before_anything_was_seen() -> None:
    assert UNKNOWN.probability == 0.5
    assert not UNKNOWN.is_known
    assert UNKNOWN.sign(line()) == 0.0


def test_the_way_round_that_predicts_better_gets_likelier_until_it_is_sure() -> None:
    known, before = UNKNOWN, 0.5
    for _ in range(12):
        known = pushed(known, 0.004, 0.006)
        assert known.probability > before
        assert known.is_known == (known.probability >= SURE)
        assert known.sign(line()) == (1.0 if known.is_known else 0.0)
        before = known.probability
    assert known.is_known


def test_the_other_way_round_is_as_well_known() -> None:
    known = pushed(pushed(UNKNOWN, 0.05, 0.002), 0.05, 0.002)
    assert known.sign(line()) == -1.0
    assert known.sign(line()[:, ::-1]) == 1.0


def test_predictions_that_err_alike_or_are_not_finite_say_nothing() -> None:
    assert pushed(UNKNOWN, 0.005, -0.005).log_odds == pytest.approx(0.0, abs=1e-3)
    assert pushed(UNKNOWN, math.nan, 0.001).log_odds == 0.0
    assert pushed(UNKNOWN, 0.001, math.nan).log_odds == 0.0


def test_a_single_push_however_badly_it_is_predicted_is_weighed_by_the_ratio_of_its_errors() -> None:
    near, far = (pushed(UNKNOWN, error_m, 1.2 * error_m).log_odds for error_m in (0.02, 0.2))
    assert near == pytest.approx(far, rel=0.02)
    assert far == pytest.approx(2 * math.log(1.2), rel=0.01)


def test_errors_that_are_as_small_as_those_of_views_say_little() -> None:
    assert pushed(UNKNOWN, 0.0, 0.0005).log_odds < 1.0


def test_ends_are_kept_as_the_rope_turns_over() -> None:
    known = sure()
    told = known.log_odds
    for step in range(1, 13):
        before, after = line((step - 1) * math.pi / 6), line(step * math.pi / 6)
        seen = before if step % 2 else before[:, ::-1]
        moved = after if step % 2 else after[:, ::-1]
        known = known.observe(seen, errors(moved, 0.005, 0.005), moved)
        assert known.sign(after) == 1.0
        assert abs(known.log_odds) == pytest.approx(told)
    assert known.sign(line()) == 1.0


@pytest.mark.parametrize("there", [line(math.pi / 2), line(aside_m=1.0), np.zeros((2, 0), np.float32)])
def test_of_a_rope_that_may_lie_either_way_round_nothing_is_known_any_more(there: Centreline) -> None:
    known = sure()
    assert known.sign(there) == 0.0
    again = known.observe(there, errors(there, 0.005, 0.005), there) if there.size else known.for_odd_parameters((1.0,))
    assert again.log_odds == 0.0


def test_it_is_about_one_model_and_sent_to_other_processes() -> None:
    known = pushed(UNKNOWN.for_odd_parameters((0.5,)), 0.001, 0.02)
    assert known.for_odd_parameters((0.5,)) is known
    assert known.for_odd_parameters((-0.5,)).log_odds == 0.0
    sent = pickle.loads(pickle.dumps(known))
    assert sent.log_odds == known.log_odds
    np.testing.assert_array_equal(sent.line, known.line)
