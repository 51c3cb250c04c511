"""A demonstrated motion is simulated as that of a plan is, for the object as it lies now."""

from itertools import pairwise

import numpy as np
import pytest

from app.core.errors import PlanningError
from app.core.motion import TOOL_DOWN
from app.jobs.shown_motion import predict_motion
from app.jobs.worker_api import nominal_model
from app.tasks import load


def pushed(x: np.ndarray, height_m: float, ahead_m: float) -> np.ndarray:
    """Poses of a tool that comes down beside the middle of the object, pushes along x, and goes up again."""
    middle = x[:, :2].mean(0)
    begin, end = middle - np.array([0.04, 0.0]), middle + np.array([ahead_m, 0.0])
    corners = np.array([[*begin, 0.1], [*begin, height_m], [*end, height_m], [*end, 0.1]])
    path = np.concatenate([np.linspace(a, b, 30) for a, b in pairwise(corners)])
    return np.concatenate([path, np.tile([*TOOL_DOWN, 0.0], (len(path), 1))], axis=1)


@pytest.mark.parametrize("name", ["rope_push", "rope_push@rods"])
def test_a_rope_is_moved_where_it_was_pushed_and_nowhere_by_a_motion_over_it(name: str) -> None:
    task = load(name)
    line = np.stack([np.full(41, 0.55), np.linspace(-0.2, 0.2, 41), np.full(41, task.rope.radius_m)], axis=1)
    x, model = task.particles(line, 300), nominal_model(name)
    after = predict_motion(name, x, model, pushed(x, task.finger.push_height_m, 0.05))
    moved = np.linalg.norm(after - x, axis=1)
    near = np.abs(x[:, 1]) < 0.02
    assert after.shape == x.shape
    assert 0.03 < (after - x)[near, 0].mean() < 0.08
    assert moved[np.abs(x[:, 1]) > 0.18].mean() < 0.02
    still = predict_motion(name, x, model, pushed(x, 0.08, 0.05))
    assert np.linalg.norm(still - x, axis=1).mean() < 0.004


def test_a_motion_without_what_the_task_needs_is_refused_in_words() -> None:
    cloth = load("cloth_hang")
    x = cloth.particles(cloth.start(0), 256)
    with pytest.raises(PlanningError, match="openings"):
        predict_motion("cloth_hang", x, nominal_model("cloth_hang"), np.zeros((0, 8)))
