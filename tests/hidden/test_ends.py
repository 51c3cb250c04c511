"""The bench of a rope's ends: what is predicted before anything is known, and what its summary counts."""

from dataclasses import replace

import pytest

from bench.hidden.ends import PredictedPush, predicted_pushes, summary

LINE = PredictedPush(
    effect="mass_heterogeneity",
    size=1.0,
    seed=0,
    push=0,
    sign=1.0,
    log_odds=1.0,
    errors_mm=(5.0, 4.0, 3.0, 3.0, 6.0),
    moved_mm=20.0,
    seen_mm=(3.0, 6.0),
)


@pytest.mark.slow
def test_before_the_first_push_is_seen_what_is_followed_is_what_is_even() -> None:
    first, second = predicted_pushes("mass_heterogeneity", 1.5, 3, 2)
    _, even, known, true, contrary = first.errors_mm
    assert first.sign == 0.0
    assert known == even
    assert true != contrary
    assert first.moved_mm > 0.0
    assert second.push == 1
    gained = first.log_odds * (first.seen_mm[1] - first.seen_mm[0])
    assert gained > 0.0, "the odds are for the way round that predicts better"


def test_a_summary_has_the_mean_errors_and_the_shares_of_signs() -> None:
    found = summary([LINE, replace(LINE, sign=0.0, errors_mm=(7.0, 4.0, 4.0, 3.0, 6.0)), replace(LINE, sign=-1.0)])
    assert found["nominal"] == pytest.approx(17 / 3)
    assert found["followed"] == pytest.approx(10 / 3)
    assert [found[name] for name in ("right", "wrong", "unknown")] == pytest.approx([1 / 3] * 3)
