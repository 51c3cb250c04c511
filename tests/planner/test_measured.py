"""Actions read back from measured poses, as learning from a demonstration needs them."""

import jax.numpy as jnp
import numpy as np
import pytest

from app.config import Site
from app.core.motion import pointing_down
from app.policy.base import PlanningState
from app.tasks import load, names

COUNT = 6


@pytest.mark.parametrize("name", names())
def test_an_action_is_read_back_from_the_poses_of_its_motion(name: str) -> None:
    task, rng = load(name), np.random.default_rng(0)
    x = task.goal(0, task.preset("cpu").particle_count)
    tool = pointing_down(np.array([0.40, -0.05, 0.25]))
    tool[7] = 0.05
    now = PlanningState.at_rest(jnp.tile(jnp.asarray(x)[None], (COUNT, 1, 1)), tool)
    actions = np.asarray(task.actions.project(jnp.asarray(task.actions.sample(rng, x, tool, COUNT)), now))
    for action in actions:
        poses = finely(task.actions.motion(action, tool, Site()).poses)
        again = finely(task.actions.motion(task.actions.measured_action(poses), tool, Site()).poses)
        ways = [task.actions.measured_path(each) for each in (again, poses)]
        np.testing.assert_allclose(*ways, atol=3e-3)


def finely(poses: np.ndarray) -> np.ndarray:
    """Poses as in a log: many on each segment."""
    at = np.linspace(0, len(poses) - 1, 40 * (len(poses) - 1) + 1)
    return np.stack([np.interp(at, np.arange(len(poses)), column) for column in poses.T], axis=1)
