"""Occlusion memory: hidden points are kept, points seen to be gone are dropped, and no image contradicts any."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial import KDTree

from app.core.colours import ColourRange, colour_mask
from app.core.messages import Frame
from app.perception.cloud.depth import nearest, project
from app.perception.cloud.occlusion_memory import NOTHING, Memory
from app.perception.reconstruct import PriorKnowledge, Reconstructed, Reconstruction, reconstruct
from bench.tube import Tube
from tests.perception.hiding import screened, touched
from tests.perception.scene import ROPE_RGB, random_tube, views

HOW = Reconstruction(colour=ColourRange.around(ROPE_RGB), particle_count=300)
GAP_M, NEAR_M = 0.015, 0.008


def at(frames: Sequence[Frame], time_s: float) -> list[Frame]:
    return [replace(frame, time_s=time_s) for frame in frames]


def after(frames: Sequence[Frame], memory: Memory) -> Reconstructed:
    return reconstruct(frames, HOW, known=PriorKnowledge(memory=memory))


def middle(tube: Tube) -> np.ndarray:
    """The part of the tube that is to be hidden: a fifth of its length."""
    count = len(tube.curve)
    return tube.curve[2 * count // 5 : 3 * count // 5]


def shifted(tube: Tube, x: float, y: float) -> Tube:
    return Tube(curve=tube.curve + np.array([x, y, 0.0]), radius_m=tube.radius_m)


def away(part: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Distance [m] from each point of a part of the tube's axis to the nearest particle."""
    return KDTree(positions).query(part)[0]


@pytest.fixture(scope="module")
def frames(tube) -> list[Frame]:
    return views(tube)


@pytest.fixture(scope="module")
def first(frames) -> Reconstructed:
    return reconstruct(frames, HOW)


@pytest.fixture(scope="module")
def hidden(tube) -> list[Frame]:
    """Views of the tube a second later, with a screen in front of its middle."""
    return at(screened(views(tube, 1), middle(tube)), 1.0)


def test_what_is_hidden_is_kept_where_it_was_and_marked_as_predicted(tube, first, hidden):
    without, kept = reconstruct(hidden, HOW), after(hidden, first.memory)
    assert away(middle(tube), without.positions).max() > GAP_M
    assert away(tube.curve, kept.positions).max() < GAP_M
    assert not without.predicted.any()
    to_hidden = away(kept.positions[kept.predicted], middle(tube))
    assert 0.15 < kept.predicted.mean() < 0.5
    # The screen covers 25 pixels, about 3 cm, beside the hidden part.
    assert to_hidden.max() < 0.05
    assert away(middle(tube)[2:-2], kept.positions[kept.predicted]).max() < GAP_M


def test_nothing_is_kept_or_predicted_where_all_is_seen(frames, first):
    again = after(at(frames, 1.0), first.memory)
    np.testing.assert_array_equal(again.positions, first.positions)
    np.testing.assert_array_equal(again.memory.points, first.memory.points)
    assert not again.predicted.any()


def test_looking_again_at_what_has_not_changed_changes_nothing(first, hidden):
    once = after(hidden, first.memory)
    twice = after(at(hidden, 2.0), once.memory)
    np.testing.assert_array_equal(twice.positions, once.positions)
    np.testing.assert_array_equal(twice.predicted, once.predicted)
    np.testing.assert_array_equal(twice.memory.points, once.memory.points)


@pytest.mark.parametrize("seed", range(3))
def test_what_is_seen_to_be_gone_is_dropped(seed):
    tube = random_tube(seed)
    moved = shifted(tube, 0.0, 0.06)
    before = reconstruct(views(tube, seed), HOW)
    now = after(at(views(moved, seed), 1.0), before.memory)
    assert moved.outside(now.surface).max() < NEAR_M
    assert now.predicted.mean() < 0.02


def test_what_was_hidden_is_dropped_once_its_place_is_seen_empty(tube, first, hidden):
    kept = after(hidden, first.memory)
    gone = shifted(tube, 0.0, 0.06)
    now = after(at(views(gone, 2), 2.0), kept.memory)
    assert gone.outside(now.surface).max() < NEAR_M


def test_what_was_hidden_and_is_seen_again_is_no_longer_predicted(tube, first, hidden):
    kept = after(hidden, first.memory)
    now = after(at(views(tube, 2), 2.0), kept.memory)
    assert now.predicted.mean() < 0.02
    assert tube.outside(now.positions).mean() < 0.001


def test_what_has_been_hidden_for_too_long_is_given_up_and_counted(tube, first, hidden):
    kept = after(hidden, first.memory)
    late = after(at(hidden, HOW.hidden_s + 2.0), kept.memory)
    assert kept.expired == 0
    assert late.expired > 100
    assert not late.predicted.any()
    assert away(middle(tube), late.positions).max() > GAP_M


def test_a_task_whose_object_moves_unseen_remembers_nothing(frames):
    assert reconstruct(frames, replace(HOW, hidden_s=0.0)).memory is NOTHING


@pytest.mark.parametrize("seed", range(4))
def test_no_image_contradicts_a_point_that_is_kept(seed):
    tube = random_tube(seed)
    before = reconstruct(views(tube, seed), HOW)
    moved = shifted(tube, 0.02, 0.01)
    frames = at(screened(views(moved, seed + 10), middle(moved)), 1.0)
    memory = after(frames, before.memory).memory
    kept = memory.points[memory.seen_s < 1.0]
    assert len(kept) > 100
    for frame in frames:
        column, row, z = project(kept, frame.camera).T
        at_pixel = np.rint(row).astype(int), np.rint(column).astype(int)
        own = cv2.dilate(colour_mask(frame.color, HOW.colour).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        measured_m = nearest(frame.depth)[at_pixel] * frame.camera.depth_unit_m
        # Something is in front of it, or its own colour is there, or what is there is where it was.
        assert ((measured_m < z - HOW.see_through_m) | own[at_pixel] | (np.abs(measured_m - z) < 0.009)).all()


def test_a_reading_that_is_missing_does_not_make_the_object_absent(tube, first):
    glittering = at(touched(views(tube, 1), middle(tube), depth=0), 1.0)
    assert away(middle(tube), reconstruct(glittering, HOW).positions).max() > GAP_M
    assert away(middle(tube), after(glittering, first.memory).positions).max() < GAP_M


def test_a_change_of_colour_where_depth_stays_does_not_make_the_object_absent(tube, first):
    dark = at(touched(views(tube, 1), middle(tube), grey=60), 1.0)
    assert away(middle(tube), reconstruct(dark, HOW).positions).max() > GAP_M
    assert away(middle(tube), after(dark, first.memory).positions).max() < GAP_M
