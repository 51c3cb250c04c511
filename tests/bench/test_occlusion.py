"""The bench of what is hidden hides what it says, and sees the better the more is done about it."""

import numpy as np
import pytest

from app.tasks import load
from bench.flaws import flickering
from bench.occlusion import photographed, scene, scored, ways


@pytest.mark.parametrize("name", ["rope_push", "bean_sweep"])
def test_a_share_is_hidden_and_tracking_finds_it_again(name: str):
    task = load(name)
    now = scene(task, 1, 0.2, "the object's", 0.0)
    assert now.hidden == pytest.approx(0.2, abs=0.02)
    truth = task.particles(now.now.nodes, 2000)
    scores = {way: scored(seen, truth, task, now.now) for way, seen in ways(now, 1).items() if seen is not None}
    covered = {way: share for way, (_, share) in scores.items()}
    assert covered["nothing"] < covered["mask"] < 0.9
    assert covered["mask + tracking"] > 0.98
    assert covered["hull + tracking"] > 0.98


def test_a_band_of_each_image_flickers():
    task = load("rope_push")
    frames = photographed(task.stage, scene(task, 0, 0.0, "grey", 0.0).now, np.random.default_rng(0), time_s=0.0)
    dark = flickering(frames, np.random.default_rng(0))
    assert all((a.color[200] > 3 * b.color[200]).any() for a, b in zip(frames, dark, strict=True))
    assert all((a.color[400] == b.color[400]).all() for a, b in zip(frames, dark, strict=True))
