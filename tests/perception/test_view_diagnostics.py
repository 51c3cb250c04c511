"""Diagnostics of the views before there are particles: masks, counts, and distances between the cameras' points."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.colours import ColourRange, colour_mask
from app.core.errors import PerceptionError
from app.perception.cloud.view_diagnostics import apart_m
from app.perception.reconstruct import Reconstruction, diagnose_views, reconstruct
from tests.perception.scene import ROPE_RGB, views

HOW = Reconstruction(colour=ColourRange.around(ROPE_RGB), particle_count=300)


@pytest.fixture(scope="module")
def frames(tube):
    return views(tube)


def test_a_reconstruction_tells_what_each_view_showed(frames):
    looks = reconstruct(frames, HOW).looks
    assert [look.camera for look in looks] == ["left", "right"]
    for look, frame in zip(looks, frames, strict=True):
        whole = colour_mask(frame.color, HOW.colour)
        assert look.pixels == whole.sum() > 1000
        np.testing.assert_array_equal(look.mask, whole[::2, ::2])
        assert 0 < look.points <= look.pixels


def test_what_is_too_little_for_particles_is_told_all_the_same(frames):
    blue = replace(HOW, colour=ColourRange(hue_low_deg=270.0, hue_high_deg=300.0))
    with pytest.raises(PerceptionError):
        reconstruct(frames, blue)
    looks = diagnose_views(frames, blue)
    assert [look.pixels for look in looks] == [0, 0]
    assert [look.points for look in looks] == [0, 0]
    assert all(np.isnan(look.apart_m) for look in looks)


def test_a_camera_out_of_place_shows_in_the_distance_between_the_views(frames):
    usual = [look.apart_m for look in diagnose_views(frames, HOW)]
    assert max(usual) < 0.003
    pose = frames[0].camera.T_world_camera.copy()
    pose[2, 3] += 0.006
    moved = replace(frames[0], camera=replace(frames[0].camera, T_world_camera=pose))
    assert max(look.apart_m for look in diagnose_views([moved, frames[1]], HOW)) > 0.004


def test_of_three_views_the_one_that_is_off_is_the_farthest(frames):
    rng = np.random.default_rng(0)
    plate = rng.uniform((0.4, -0.1, 0.0), (0.6, 0.1, 0.002), (3000, 3)).astype(np.float32)
    apart = apart_m([plate, plate[::2] + np.float32(0.0005), plate + np.array([0.0, 0.0, 0.01], np.float32)])
    assert np.argmax(apart) == 2
    assert apart[2] > 0.007
    assert max(apart[:2]) < 0.003


def test_nothing_is_compared_with_nothing():
    nothing = np.zeros((0, 3), np.float32)
    assert np.isnan(apart_m([nothing, nothing])).all()
    assert np.isnan(apart_m([np.zeros((500, 3), np.float32)])).all()
    assert apart_m([]) == []
