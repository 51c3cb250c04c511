"""Temporal depth filter: the frame before fills missing readings and removes readings that last one frame only."""

from dataclasses import replace

import numpy as np
import pytest

from app.perception.body.temporal_depth_filter import JUMP_M, filter_depth
from tests.perception.scene import render, two_cameras, views


@pytest.fixture(scope="module")
def pair(tube):
    """Two frames of one camera that differ in their noise."""
    return views(tube, 0)[0], views(tube, 1)[0]


def exact(tube):
    """Depth image without noise, dropout or flying pixels."""
    return render(tube, two_cameras()[0], np.random.default_rng(0), noise_m=0.0, dropout=0.0, flying=0.0).depth


def wrong(frame, truth) -> float:
    """The share of all pixels whose reading is off by more than a jump."""
    off = np.abs(frame.depth.astype(int) - truth) * frame.camera.depth_unit_m
    return float(((frame.depth > 0) & (off > JUMP_M)).mean())


def test_a_missing_reading_is_the_former_one(pair):
    before, now = pair
    steady = filter_depth(now, before)
    lost, filled = (now.depth == 0).mean(), (steady.depth == 0).mean()
    assert lost > 0.01
    assert filled < 0.35 * lost


def test_flying_pixels_are_fewer(tube, pair):
    before, now = pair
    truth = exact(tube)
    assert wrong(filter_depth(now, before), truth) < 0.5 * wrong(now, truth)


def test_where_something_moved_the_new_reading_counts(pair):
    before, now = pair
    color, depth = now.color.copy(), now.depth.copy()
    color[100:140, 100:140], depth[100:140, 100:140] = (20, 200, 20), 500
    moved = filter_depth(replace(now, color=color, depth=depth), before)
    assert (moved.depth[100:140, 100:140] == 500).all()


def test_what_stays_after_a_jump_is_believed_one_frame_later(pair):
    before, now = pair
    depth = now.depth.copy()
    depth[100:140, 100:140] = 500
    jumped = replace(now, depth=depth)
    assert (filter_depth(jumped, before).depth[100:140, 100:140] == 0).mean() > 0.95
    assert (filter_depth(jumped, jumped).depth[100:140, 100:140] == 500).all()


def test_without_a_frame_before_nothing_is_changed(pair):
    assert filter_depth(pair[1], None) is pair[1]


def test_a_frame_of_another_size_is_not_asked(pair):
    before, now = pair
    assert filter_depth(now, replace(before, color=before.color[::2, ::2], depth=before.depth[::2, ::2])) is now
