"""The solid under a surface: known solids are recovered from the part of their surface that cameras see."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from app.perception.body.fill import CELL_M, Solid, fill, points_inside


def seen_tube(rng: np.random.Generator, *, radius_m: float, length_m: float = 0.2, count: int = 6000) -> np.ndarray:
    """A straight tube along x that rests on z = 0, from 40 degrees below its widest line up."""
    angle = rng.uniform(-0.7, np.pi + 0.7, count)
    x = rng.uniform(0, length_m, count)
    return np.stack([x, radius_m * np.cos(angle), radius_m * (1 + np.sin(angle))], axis=1).astype(np.float32)


def turned(points: np.ndarray, angle: float, shift: np.ndarray) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return (points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + shift).astype(np.float32)


def round_solid(surface: np.ndarray, half_width_m: float = 0.010) -> Solid:
    return fill(surface, table_m=0.0, half_width_m=half_width_m, underside="round")


@pytest.mark.parametrize("radius_m", [0.006, 0.008, 0.012])
@pytest.mark.parametrize("noise_m", [0.0, 0.0005])
def test_a_tube_is_recovered(radius_m, noise_m):
    rng = np.random.default_rng(0)
    surface = seen_tube(rng, radius_m=radius_m)
    surface = surface + rng.normal(0, noise_m, surface.shape).astype(np.float32)
    solid = round_solid(surface, half_width_m=1.2 * radius_m)
    body = points_inside(solid, 0.0015)
    assert solid.volume_m3 == pytest.approx(np.pi * radius_m**2 * 0.2, rel=0.12)
    assert body[:, 2].mean() == pytest.approx(radius_m, abs=0.0004)
    assert body[:, 1].mean() == pytest.approx(0, abs=0.0004)
    # A disc's variance about each diameter is a quarter of its squared radius; noise widens the outline.
    assert body[:, 1].std() == pytest.approx(radius_m / 2, abs=0.05 * radius_m + noise_m)
    assert body[:, 2].std() == pytest.approx(radius_m / 2, abs=0.05 * radius_m + noise_m)
    outside = np.maximum(np.hypot(body[:, 1], body[:, 2] - radius_m) - radius_m, 0)
    assert outside.mean() < 0.0003


def test_a_half_seen_ball_becomes_a_ball():
    rng = np.random.default_rng(1)
    normal = rng.normal(size=(4000, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    radius_m = 0.012
    surface = radius_m * (normal[normal[:, 2] > -0.4] + [0, 0, 1])
    solid = round_solid(surface.astype(np.float32), half_width_m=0.014)
    assert solid.volume_m3 == pytest.approx(4 / 3 * np.pi * radius_m**3, rel=0.10)
    assert points_inside(solid, 0.001)[:, 2].mean() == pytest.approx(radius_m, abs=0.0004)


@pytest.mark.parametrize("underside", ["round", "flat"])
def test_a_flat_topped_block_is_solid_down_to_the_table(underside):
    rng = np.random.default_rng(2)
    top = np.concatenate([rng.uniform(0, 0.05, (8000, 2)), np.full((8000, 1), 0.02)], axis=1).astype(np.float32)
    solid = fill(top, table_m=0.0, half_width_m=0.01, underside=underside)
    assert solid.volume_m3 == pytest.approx(0.05 * 0.05 * 0.02, rel=0.05)
    assert points_inside(solid, 0.002)[:, 2].mean() == pytest.approx(0.01, abs=1e-4)


def test_two_strands_side_by_side_stay_two():
    surface = seen_tube(np.random.default_rng(3), radius_m=0.008)
    gap = np.float32([0, 0.026, 0])
    both = np.concatenate([surface, surface + gap])
    solid = round_solid(both)
    assert solid.volume_m3 == pytest.approx(2 * round_solid(surface).volume_m3, rel=0.02)
    y = points_inside(solid, 0.0015)[:, 1]
    assert not ((y > 0.0095) & (y < 0.0165)).any()


@settings(max_examples=25)
@example(angle=0.008, x=0.0, y=0.008, table_m=0.008)
@given(angle=st.floats(0, 2 * np.pi), x=st.floats(-1, 1), y=st.floats(-1, 1), table_m=st.floats(-0.1, 0.1))
def test_where_the_object_lies_makes_no_difference(angle, x, y, table_m):
    surface = seen_tube(np.random.default_rng(4), radius_m=0.008)
    here = round_solid(surface)
    moved = turned(surface, angle, np.array([x, y, table_m]))
    there = fill(moved, table_m=table_m, half_width_m=0.01, underside="round")
    assert there.volume_m3 == pytest.approx(here.volume_m3, rel=0.03)
    # Every cell is sampled: with columns 2 mm apart, one more or less at an end would move the centre by 1 mm.
    centre = points_inside(here, CELL_M).mean(axis=0, keepdims=True)
    expected = turned(centre, angle, np.array([x, y, table_m]))
    np.testing.assert_allclose(points_inside(there, CELL_M).mean(axis=0, keepdims=True), expected, atol=6e-4)


@given(spacing_m=st.floats(0.001, 0.003))
def test_points_fill_the_solid_evenly(spacing_m):
    solid = round_solid(seen_tube(np.random.default_rng(5), radius_m=0.008, length_m=0.1))
    points = points_inside(solid, spacing_m)
    assert len(points) == pytest.approx(solid.volume_m3 / spacing_m**3, rel=0.12)
    x = points[:, 0]
    left, right = (np.count_nonzero(half) for half in (x < 0.05, x >= 0.05))
    assert left == pytest.approx(right, rel=0.1)
    assert points[:, 2].min() >= 0
    assert points[:, 2].max() <= solid.top.max()


def test_a_sheet_thinner_than_the_spacing_has_its_share_of_points():
    rng = np.random.default_rng(6)
    sheet = np.concatenate([rng.uniform(0, 0.1, (20_000, 2)), np.full((20_000, 1), 0.001)], axis=1).astype(np.float32)
    solid = fill(sheet, table_m=0.0, half_width_m=0.01, underside="flat")
    points = points_inside(solid, 0.003)
    assert len(points) == pytest.approx(solid.volume_m3 / 0.003**3, rel=0.1)
    assert np.ptp(points[:, :2], axis=0) == pytest.approx(0.1, abs=0.012)
