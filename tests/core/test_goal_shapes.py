"""Goals that are drawn: the object keeps its size, and is where it was put."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.goal_shapes import along, gather, transform
from app.core.types import Points

LENGTH_M, RADIUS_M = 0.4, 0.008


def rope(count: int = 300, bend_1_m: float = 0.0, radius_m: float = RADIUS_M) -> Points:
    """A rope about (0.5, 0), its particles in no order."""
    rng = np.random.default_rng(0)
    along_m = rng.uniform(-LENGTH_M / 2, LENGTH_M / 2, count)
    off = rng.uniform(-radius_m, radius_m, (count, 2)) * 0.7
    straight = np.column_stack([0.5 + off[:, 0], along_m, RADIUS_M + off[:, 1]]).astype(np.float32)
    return transform(straight, to=np.array([0.5, 0.0]), turn_rad=0.3, bend_1_m=bend_1_m)


def pairwise(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points[:, None] - points[None], axis=2)


@given(st.floats(0.3, 0.8), st.floats(-0.3, 0.3), st.floats(-6, 6))
def test_a_copy_that_is_not_bent_keeps_every_distance(x: float, y: float, turn_rad: float) -> None:
    before = rope(60)
    after = transform(before, to=np.array([x, y]), turn_rad=turn_rad, bend_1_m=0.0)
    np.testing.assert_allclose(pairwise(after), pairwise(before), atol=1e-5)
    np.testing.assert_allclose(after[:, :2].mean(0), [x, y], atol=1e-5)


@pytest.mark.parametrize("bend_1_m", [-6.0, 2.0, 8.0])
def test_a_bent_copy_has_the_curvature_that_was_asked_for_and_its_length(bend_1_m: float) -> None:
    before = rope(2000, radius_m=0.001)
    after = transform(before, to=np.array([0.5, 0.0]), turn_rad=0.0, bend_1_m=bend_1_m)
    # The circle through a bent rope: x^2 + y^2 = 2 a x + 2 b y + c.
    flat = after[:, :2].astype(float)
    a, b, c = np.linalg.lstsq(np.column_stack([2 * flat, np.ones(len(flat))]), (flat**2).sum(1), rcond=None)[0]
    assert np.sqrt(c + a**2 + b**2) == pytest.approx(1 / abs(bend_1_m), rel=0.03)
    np.testing.assert_array_equal(after[:, 2], before[:, 2])


@pytest.mark.parametrize("bend_1_m", [0.0, 7.0])
def test_laid_along_a_curve_the_object_keeps_length_and_thickness(bend_1_m: float) -> None:
    angle = np.linspace(0, 2.2, 40)
    curve = np.column_stack([0.55 + 0.2 * np.cos(angle), 0.2 * np.sin(angle)])
    laid = along(rope(600, bend_1_m), curve)
    off = np.abs(np.linalg.norm(laid[:, :2] - [0.55, 0.0], axis=1) - 0.2)
    assert off.max() < 2 * RADIUS_M
    assert off.mean() > 0.15 * RADIUS_M, "it became a line"
    covered = np.ptp(np.arctan2(laid[:, 1], laid[:, 0] - 0.55)) * 0.2
    assert covered == pytest.approx(LENGTH_M, rel=0.08)


def test_where_the_curve_is_shorter_than_the_object_it_goes_on_straight() -> None:
    laid = along(rope(600), np.array([[0.3, 0.0], [0.4, 0.0]]))
    assert laid[:, 0].min() == pytest.approx(0.3, abs=0.01)
    assert laid[:, 0].max() == pytest.approx(0.3 + LENGTH_M, rel=0.08)
    assert np.abs(laid[:, 1]).max() < 2 * RADIUS_M


def test_a_curve_whose_points_are_doubled_is_the_same_curve() -> None:
    curve = np.array([[0.3, 0.0], [0.5, 0.1], [0.7, 0.0]])
    np.testing.assert_allclose(along(rope(), np.repeat(curve, 2, axis=0)), along(rope(), curve), atol=1e-6)


@given(st.integers(2, 400), st.floats(0.01, 0.2))
def test_what_is_gathered_is_within_the_region_and_evenly_spread(count: int, radius_m: float) -> None:
    object_ = np.column_stack([np.zeros(count), np.zeros(count), np.linspace(0, 0.02, count)]).astype(np.float32)
    disc = gather(object_, middle=np.array([0.5, -0.1]), radius_m=radius_m)
    away = np.linalg.norm(disc[:, :2] - [0.5, -0.1], axis=1)
    assert away.max() <= radius_m * (1 + 1e-4)
    inner = np.count_nonzero(away < radius_m / np.sqrt(2))
    assert abs(inner - count / 2) <= 2
