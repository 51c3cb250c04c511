"""Sizes of ropes of clouds that show their surface alone: radius and length within their errors."""

import numpy as np
import pytest

from app.core.types import Cloud
from app.sim.rods.geometry.rope_size import rope_size

LENGTH_M = 0.5


def surface(
    rng: np.random.Generator, radius_m: float, noise_m: float, side_deg: float, *, rounded: bool = False
) -> Cloud:
    """A curved rope on the table, cut off or with round ends, seen from above to `side_deg` beside its top."""
    count, along = 500, np.linspace(0.0, LENGTH_M, 400)
    turn = 0.8 * np.sin(2 * rng.uniform(2, 6) * along / LENGTH_M)
    line = np.cumsum(np.stack([np.cos(turn), np.sin(turn)], axis=1), axis=0) * along[1]
    end_m = radius_m if rounded else 0.0
    at, around = rng.uniform(-end_m, LENGTH_M + end_m, count), np.radians(rng.uniform(-side_deg, side_deg, count))
    beyond = at - np.clip(at, 0, LENGTH_M)
    thick = np.sqrt(radius_m**2 - beyond**2)
    beside, heading = thick * np.sin(around), np.interp(at, along, turn)
    x, y = (np.interp(at, along, line[:, axis]) for axis in (0, 1))
    x, y = x + np.cos(heading) * beyond, y + np.sin(heading) * beyond
    points = [x - np.sin(heading) * beside, y + np.cos(heading) * beside, radius_m + thick * np.cos(around)]
    return (np.stack(points, axis=1) + rng.normal(0, noise_m, (count, 3))).astype(np.float32)


def hairpin(rng: np.random.Generator, radius_m: float) -> Cloud:
    """The rope bent in the middle, so that its halves touch."""
    count = 500
    at, around = rng.uniform(0, LENGTH_M / 2, count), np.radians(rng.uniform(-90, 90, count))
    beside = radius_m * (np.where(rng.random(count) < 0.5, -1, 1) + np.sin(around))
    return np.stack([at, beside, radius_m * (1 + np.cos(around))], axis=1).astype(np.float32)


@pytest.mark.parametrize("side_deg", [60.0, 90.0])
@pytest.mark.parametrize(("radius_m", "noise_m"), [(0.003, 0.0005), (0.004, 0.0012), (0.005, 0.0018), (0.008, 0.0012)])
def test_a_rope_seen_from_above_is_as_thick_as_is_said_and_about_as_long(
    radius_m: float, noise_m: float, side_deg: float
) -> None:
    rng = np.random.default_rng(0)
    found = rope_size([surface(rng, radius_m, noise_m, side_deg) for _ in range(6)])
    assert abs(found.radius_m - radius_m) < 2.5 * found.radius_sd_m
    assert found.radius_sd_m < 0.25 * radius_m
    assert abs(found.length_m - LENGTH_M) < min(2.5 * found.length_sd_m, 0.012)


@pytest.mark.parametrize("noise_m", [0.0005, 0.0018])
@pytest.mark.parametrize("rounded", [False, True])
def test_whether_ends_are_cut_off_or_round_is_in_the_error_of_a_length_and_zigzag_is_not(
    rounded: bool, noise_m: float
) -> None:
    rng, radius_m = np.random.default_rng(1), 0.008
    found = rope_size([surface(rng, radius_m, noise_m, 90.0, rounded=rounded) for _ in range(6)])
    assert abs(found.length_m - LENGTH_M) < 2 * found.length_sd_m
    assert found.length_sd_m < 1.2 * radius_m


@pytest.mark.parametrize("folded", [1, 3, 5])
def test_clouds_of_a_rope_that_is_folded_on_itself_do_not_say_how_long_it_is(folded: int) -> None:
    rng, radius_m = np.random.default_rng(2), 0.008
    clouds = [surface(rng, radius_m, 0.001, 90.0) for _ in range(12 - folded)]
    clouds += [hairpin(rng, radius_m) for _ in range(folded)]
    found = rope_size(clouds)
    assert abs(found.length_m - LENGTH_M) < 2 * found.length_sd_m
    assert found.length_sd_m < 1.2 * radius_m


def test_points_in_one_place_are_no_rope_and_no_crash() -> None:
    assert rope_size([np.full((40, 3), 0.01, np.float32)], 0.008).length_m == 0.0
