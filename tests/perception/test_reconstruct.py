"""From images of a known tube to particles: what is recovered, what does not matter, and what is said otherwise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from app.core.colours import ColourRange
from app.core.errors import PerceptionError
from app.core.geometry.chamfer import chamfer_m2
from app.perception.cloud.fuse import Box
from app.perception.reconstruct import Reconstruction, reconstruct
from tests.perception.scene import RADIUS_M, ROPE_RGB, camera_at, random_tube, render, turned_quarter, views

HOW = Reconstruction(colour=ColourRange.around(ROPE_RGB), particle_count=300)
TARGET_M = 0.003


def both_ways(tube, positions) -> tuple[float, float]:
    """Mean distance from the particles to the tube, and from the tube's volume to the particles [m].

    A particle stands for a ball of its share of the volume; a point within that ball is covered.
    """
    truth = tube.samples(3000, np.random.default_rng(0))
    return float(tube.outside(positions).mean()), float(tube.uncovered(truth, positions).mean())


def apart(a, b) -> float:
    """Root of the mean squared distance between two clouds of the same thing [m]."""
    return float(np.sqrt(chamfer_m2(a, b) / 2))


@pytest.fixture(scope="module")
def frames(tube):
    return views(tube)


@pytest.fixture(scope="module")
def usual(frames):
    return reconstruct(frames, HOW)


@pytest.mark.parametrize("seed", range(5))
def test_a_tube_on_the_table_is_recovered(seed):
    tube = random_tube(seed)
    seen = reconstruct(views(tube, seed), HOW)
    assert seen.positions.shape == (300, 3)
    assert seen.positions.dtype == np.float32
    to_truth, from_truth = both_ways(tube, seen.positions)
    assert to_truth < 0.0005
    assert from_truth < 0.0010
    on_skin = np.abs(tube.distance_to_axis(seen.surface) - RADIUS_M)
    assert on_skin.mean() < 0.001
    assert np.quantile(on_skin, 0.99) < TARGET_M


@pytest.mark.parametrize("seed", range(3))
def test_its_cross_section_is_centred_and_as_wide_as_the_tube(seed):
    tube = random_tube(seed)
    positions = reconstruct(views(tube, seed), replace(HOW, particle_count=2000)).positions
    assert positions[:, 2].mean() == pytest.approx(RADIUS_M, abs=0.0005)
    # In a disc the mean distance to the axis is two thirds of the radius.
    assert tube.distance_to_axis(positions).mean() == pytest.approx(2 / 3 * RADIUS_M, rel=0.08)


@pytest.mark.parametrize("count", [1, 50, 777])
def test_the_count_is_the_task_s(frames, count):
    assert reconstruct(frames, replace(HOW, particle_count=count)).positions.shape == (count, 3)


def test_the_order_of_the_frames_does_not_matter(frames, usual):
    other = reconstruct(frames[::-1], HOW)
    np.testing.assert_array_equal(other.positions, usual.positions)
    np.testing.assert_array_equal(other.surface, usual.surface)


def test_the_same_frames_and_seed_give_the_same_particles_and_another_seed_the_same_object(frames, usual):
    np.testing.assert_array_equal(reconstruct(frames, HOW).positions, usual.positions)
    other = reconstruct(frames, replace(HOW, seed=1)).positions
    assert not np.array_equal(other, usual.positions)
    assert apart(other, usual.positions) < 0.004


def test_a_camera_turned_about_its_axis_sees_the_same_object(frames, usual):
    turned = reconstruct([turned_quarter(frames[0]), frames[1]], HOW)
    assert apart(turned.surface, usual.surface) < 0.0005
    assert apart(turned.positions, usual.positions) < 0.004


def test_cameras_elsewhere_see_the_same_object(tube, usual):
    rng = np.random.default_rng(5)
    eyes = {"front": (1.15, 0.1, 0.5), "back": (0.0, -0.1, 0.55), "top": (0.5, 0.05, 0.8)}
    frames = [render(tube, camera_at(eye, name=name), rng) for name, eye in eyes.items()]
    assert apart(reconstruct(frames, HOW).surface, usual.surface) < 0.0025
    assert max(both_ways(tube, reconstruct(frames, HOW).positions)) < 0.001


@pytest.mark.parametrize(
    "flaws",
    [{"noise_m": 0.002}, {"dropout": 0.25}, {"flying": 1.0}, {"noise_m": 0.002, "dropout": 0.15, "flying": 1.0}],
    ids=str,
)
def test_the_sensor_s_flaws_are_tolerated(tube, flaws):
    seen = reconstruct(views(tube, 7, **flaws), HOW)
    assert max(both_ways(tube, seen.positions)) < 0.001


def test_what_the_finger_hides_from_one_camera_the_other_shows(tube):
    middle = tube.curve[len(tube.curve) // 2]
    seen = reconstruct(views(tube, finger_xy=(middle[0], middle[1])), HOW)
    to_truth, from_truth = both_ways(tube, seen.positions)
    assert to_truth < 0.0005
    assert from_truth < 0.0015
    hidden = tube.samples(4000, np.random.default_rng(1))
    hidden = hidden[np.linalg.norm(hidden[:, :2] - middle[:2], axis=1) < 0.012]
    assert KDTree(seen.positions).query(hidden)[0].max() < 0.016


def test_one_view_is_enough_for_the_side_it_sees(tube, frames):
    seen = reconstruct(frames[:1], HOW)
    to_truth, from_truth = both_ways(tube, seen.positions)
    assert to_truth < 0.0005
    assert from_truth < TARGET_M


def test_the_box_cuts_off_what_lies_beyond_it(tube, frames):
    x = float(np.median(tube.curve[:, 0]))
    near = reconstruct(frames, replace(HOW, box=Box(low=(0.0, -0.5, 0.0), high=(x, 0.5, 0.1))))
    assert near.surface[:, 0].max() <= x
    assert near.surface[:, 0].min() == pytest.approx(tube.curve[:, 0].min() - RADIUS_M, abs=0.004)


def test_no_frame_is_said():
    with pytest.raises(PerceptionError, match=r"no frame.*wait for the cameras"):
        reconstruct([], HOW)


def test_an_absent_object_is_said_with_what_each_camera_saw(frames):
    blue = replace(HOW, colour=ColourRange(hue_low_deg=270.0, hue_high_deg=300.0))
    with pytest.raises(PerceptionError, match=r"'left' saw 0 pixels.*'right' saw 0 pixels.*colour range"):
        reconstruct(frames, blue)


def test_an_object_whose_depth_makes_no_sense_is_told_from_an_absent_one(frames):
    blind = [replace(frame, depth=np.full_like(frame.depth, 10)) for frame in frames]
    with pytest.raises(PerceptionError, match=r"'left' saw [1-9]\d{3} pixels of its colour, 0 of them with a depth"):
        reconstruct(blind, HOW)


def test_an_object_outside_the_box_is_said_with_the_box(frames):
    elsewhere = replace(HOW, box=Box(low=(2.0, 2.0, 0.0), high=(3.0, 3.0, 0.1)))
    with pytest.raises(PerceptionError, match=r"Put the object in the box \(x 2 to 3 m"):
        reconstruct(frames, elsewhere)


def test_too_small_an_object_is_said_with_the_count(frames):
    with pytest.raises(PerceptionError, match=r"has \d+ points, 100000 are needed"):
        reconstruct(frames, replace(HOW, min_points=100_000))
