"""A bowl that is tilted slowly keeps what hydrostatics say, in the planner's model and in the cell's world."""

import numpy as np
import pytest

from bench.lip import BOWLS, in_the_model, in_the_world, kept, kept_at_rest

TILTS_RAD = (0.5, 0.7, 0.9, 1.1)
RADIUS_M, VOLUME_M3 = BOWLS[0]


def test_a_bowl_keeps_all_until_its_lip_is_at_the_level_and_nothing_on_its_side() -> None:
    assert kept_at_rest(0.2, RADIUS_M, VOLUME_M3) == 1.0
    assert kept_at_rest(np.pi / 2, RADIUS_M, VOLUME_M3) == pytest.approx(0.0)
    half = 2 / 3 * np.pi * RADIUS_M**3
    assert kept_at_rest(0.0, RADIUS_M, half) == pytest.approx(1.0)
    # A cap half as deep as the bowl has 5/16 of its volume.
    assert kept_at_rest(np.pi / 6, RADIUS_M, half) == pytest.approx(5 / 16)


def error(shares: np.ndarray, radius_m: float, volume_m3: float) -> float:
    """RMS difference from hydrostatics."""
    rest = [kept_at_rest(tilt, radius_m, volume_m3) for tilt in TILTS_RAD]
    return float(np.sqrt(np.mean((shares - rest) ** 2)))


@pytest.mark.parametrize(("radius_m", "volume_m3"), BOWLS)
def test_water_of_the_model_runs_out_when_it_must(radius_m: float, volume_m3: float) -> None:
    assert error(kept(in_the_model(radius_m, volume_m3, lowered=True), TILTS_RAD), radius_m, volume_m3) < 0.09


def test_a_wall_up_to_the_rim_would_hold_what_has_to_be_gone() -> None:
    assert error(kept(in_the_model(RADIUS_M, VOLUME_M3, lowered=False), TILTS_RAD), RADIUS_M, VOLUME_M3) > 0.25


@pytest.mark.slow
def test_water_of_the_world_runs_out_when_it_must() -> None:
    assert error(kept(in_the_world(), TILTS_RAD), RADIUS_M, VOLUME_M3) < 0.07
