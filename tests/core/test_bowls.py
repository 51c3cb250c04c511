"""A liquid in half of a hollow sphere stands as geometry says."""

import numpy as np
import pytest

from app.core.geometry.bowls import cap_centroid_m, cap_depth_m, centre_of_bowl, refill

RADIUS_M = 0.055


def cap(depth_m: float, count: int = 400_000) -> np.ndarray:
    """Points evenly through what stands so deep about the origin."""
    rng = np.random.default_rng(0)
    points = rng.uniform([-RADIUS_M, -RADIUS_M, -RADIUS_M], [RADIUS_M, RADIUS_M, depth_m - RADIUS_M], (count, 3))
    return points[np.linalg.norm(points, axis=1) < RADIUS_M]


@pytest.mark.parametrize("depth_m", [0.005, 0.02, 0.05])
def test_a_volume_stands_as_deep_as_it_fills_the_bowl(depth_m: float) -> None:
    box_m3 = (2 * RADIUS_M) ** 2 * depth_m
    assert cap_depth_m(box_m3 * len(cap(depth_m)) / 400_000, RADIUS_M) == pytest.approx(depth_m, rel=0.01)


@pytest.mark.parametrize("depth_m", [0.005, 0.02, 0.05])
def test_its_middle_is_as_far_below_the_centre_as_its_points_are(depth_m: float) -> None:
    assert cap_centroid_m(depth_m, RADIUS_M) == pytest.approx(-cap(depth_m)[:, 2].mean(), rel=0.01)


def test_the_bowl_is_found_about_what_rests_in_it() -> None:
    place = np.array([0.4, -0.1, 0.2])
    depth = cap_depth_m(1.2e-4, RADIUS_M)
    np.testing.assert_allclose(centre_of_bowl(cap(depth) + place, RADIUS_M, 1.2e-4), place, atol=3e-4)


def test_more_than_it_holds_stands_up_to_the_rim() -> None:
    assert cap_depth_m(1.0, RADIUS_M) == RADIUS_M


@pytest.mark.parametrize("share", [0.3, 0.8, 1.0, 1.2])
def test_what_is_refilled_stands_as_deep_as_that_volume_and_inside_of_the_bowl(share: float) -> None:
    place, volume_m3 = np.array([0.4, -0.1, 0.2]), 1.2e-4
    whole = cap(cap_depth_m(volume_m3, RADIUS_M)) + place
    other = refill(whole, place, RADIUS_M, volume_m3, share * volume_m3)
    depth = cap_depth_m(share * volume_m3, RADIUS_M)
    assert np.linalg.norm(other - place, axis=1).max() < RADIUS_M + 1e-6
    assert other[:, 2].max() - place[2] + RADIUS_M == pytest.approx(depth, rel=0.01)
    # It stays nearly as evenly spread: its middle is where that of as much would be.
    assert place[2] - other[:, 2].mean() == pytest.approx(cap_centroid_m(depth, RADIUS_M), abs=5e-4)
    if share == 1.0:
        np.testing.assert_allclose(other, whole, atol=1e-12)
