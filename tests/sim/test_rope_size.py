"""Sizes of ropes of clouds that show their surface alone: radius and length within their errors."""

import numpy as np
import pytest

from app.core.types import Cloud
from app.sim.rods.geometry.rope_size import rope_size

LENGTH_M = 0.5


def surface(rng: np.random.Generator, radius_m: float, noise_m: float, side_deg: float) -> Cloud:
    """A curved rope on the table, seen from above to `side_deg` beside its top."""
    count, along = 500, np.linspace(0.0, LENGTH_M, 400)
    turn = 0.8 * np.sin(2 * rng.uniform(2, 6) * along / LENGTH_M)
    line = np.cumsum(np.stack([np.cos(turn), np.sin(turn)], axis=1), axis=0) * along[1]
    at, around = rng.uniform(0, LENGTH_M, count), np.radians(rng.uniform(-side_deg, side_deg, count))
    beside, heading = radius_m * np.sin(around), np.interp(at, along, turn)
    x, y = (np.interp(at, along, line[:, axis]) for axis in (0, 1))
    points = [x - np.sin(heading) * beside, y + np.cos(heading) * beside, radius_m * (1 + np.cos(around))]
    return (np.stack(points, axis=1) + rng.normal(0, noise_m, (count, 3))).astype(np.float32)


@pytest.mark.parametrize("side_deg", [60.0, 90.0])
@pytest.mark.parametrize(("radius_m", "noise_m"), [(0.003, 0.0005), (0.004, 0.0012), (0.005, 0.0018), (0.008, 0.0012)])
def test_a_rope_seen_from_above_is_as_thick_as_is_said_and_about_as_long(
    radius_m: float, noise_m: float, side_deg: float
) -> None:
    rng = np.random.default_rng(0)
    found = rope_size([surface(rng, radius_m, noise_m, side_deg) for _ in range(6)])
    assert abs(found.radius_m - radius_m) < 2.5 * found.radius_sd_m
    assert found.radius_sd_m < 0.25 * radius_m
    assert abs(found.length_m - LENGTH_M) < min(2 * found.length_sd_m, 0.01)


@pytest.mark.parametrize("noise_m", [0.0005, 0.0018])
@pytest.mark.parametrize("beyond", [0.0, 2 / 3, 1.0])
def test_whether_ends_are_cut_off_or_round_is_in_the_error_of_a_length_and_zigzag_is_not(
    beyond: float, noise_m: float
) -> None:
    rng, radius_m = np.random.default_rng(1), 0.008
    of_line_m = LENGTH_M - 2 * beyond * radius_m
    found = rope_size([surface(rng, radius_m, noise_m, 90.0) for _ in range(6)])
    assert abs(found.length_m - of_line_m) < 2 * found.length_sd_m
    assert found.length_sd_m < 1.1 * radius_m
