"""Liquid in a bowl: its surface is level, it lies inside of the bowl, and it keeps its volume."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.core.geometry.bowls import cap_depth_m
from app.core.motion import pointing_down
from app.perception.body.vessels import Vessel, level_of

BOWL = Vessel(radius_m=0.055, place_m=(0.5, 0.1, 0.2))


def tilted(angle_rad: float) -> Vessel:
    pose = pointing_down(np.array(BOWL.place_m))
    turn = Rotation.from_rotvec([0.0, angle_rad, 0.0]) * Rotation.from_quat(pose[3:7], scalar_first=True)
    pose[3:7] = turn.as_quat(scalar_first=True)
    return BOWL.at(pose)


def test_a_bowl_on_a_tool_that_points_down_is_upright() -> None:
    np.testing.assert_allclose(tilted(0.0).up, (0, 0, 1), atol=1e-12)
    np.testing.assert_allclose(tilted(np.pi / 2).up, (1, 0, 0), atol=1e-12)


@pytest.mark.parametrize("volume_m3", [2e-5, 1.2e-4, 3e-4])
def test_a_volume_stands_in_an_upright_bowl_as_high_as_in_a_cap(volume_m3: float) -> None:
    level = BOWL.place_m[2] - BOWL.radius_m + cap_depth_m(volume_m3, BOWL.radius_m)
    assert BOWL.pool(volume_m3).level_m == pytest.approx(level, abs=0.0015)


@pytest.mark.parametrize("angle_rad", [0.0, 0.4, 0.8])
def test_what_is_filled_in_has_its_volume_and_is_inside(angle_rad: float) -> None:
    pool = tilted(angle_rad).pool(6e-5)
    assert pool.volume_m3 == pytest.approx(6e-5, rel=0.06)
    points = pool.points(0.003)
    assert pool.vessel.holds(points, margin_m=0.0).all()
    assert points[:, 2].max() <= pool.level_m


def test_no_more_than_a_bowl_holds_is_filled_in() -> None:
    assert BOWL.pool(1e-3).volume_m3 == pytest.approx(2 / 3 * np.pi * 0.055**3, rel=0.03)


def test_what_falls_splashes_or_clings_to_the_wall_does_not_raise_the_level() -> None:
    rng = np.random.default_rng(0)
    still, above = rng.normal(0.02, 0.0012, 300), rng.uniform(0.02, 0.08, 900)
    points = np.zeros((1200, 3), np.float32)
    points[:, 2] = np.concatenate([still, above])
    assert level_of(points[:300]) == pytest.approx(0.02, abs=3e-4)
    assert level_of(points) == pytest.approx(0.02, abs=2e-3)
