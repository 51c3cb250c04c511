"""Anderson's acceleration on iterations whose fixed point is known."""

import numpy as np
import pytest

from app.discovery.inference.anderson import AndersonExtrapolation

SIZE, FEW = 40, 12


def rounds(slope: float, *, extrapolated: bool) -> int:
    """Rounds until a contraction is within 1e-9 of its end; `slope`: what a round leaves of its slowest direction."""
    rng = np.random.default_rng(0)
    turn = np.linalg.qr(rng.normal(size=(SIZE, SIZE)))[0]
    shares = np.concatenate([slope * np.array([1.0, 0.8, 0.5]), np.zeros(SIZE - 3)])
    A, end = turn @ np.diag(shares) @ turn.T, rng.normal(size=SIZE)
    path, here = AndersonExtrapolation(), np.zeros(SIZE)
    for count in range(1000):
        reached = end + A @ (here - end)
        if np.abs(reached - end).max() < 1e-9:
            return count
        here = path.after(here, reached) if extrapolated else reached
    return 1000


@pytest.mark.parametrize("slope", [0.5, 0.9, 0.99])
def test_a_linear_iteration_with_few_slow_directions_ends_in_few_rounds(slope: float) -> None:
    assert rounds(slope, extrapolated=True) < FEW < rounds(slope, extrapolated=False)


def test_after_its_first_round_an_iteration_goes_on_from_where_that_ended() -> None:
    reached = np.array([1.0, 2.0])
    np.testing.assert_array_equal(AndersonExtrapolation().after(np.zeros(2), reached), reached)


def test_rounds_that_change_nothing_are_extrapolated_to_where_they_are() -> None:
    path, here = AndersonExtrapolation(), np.array([1.0, 2.0])
    for _ in range(3):
        np.testing.assert_allclose(path.after(here, here), here)
