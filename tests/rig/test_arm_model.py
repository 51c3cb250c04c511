"""The drawn arm reaches the whole workspace with its tool straight down."""

import numpy as np

from app.config import Workspace
from app.rig.simulated.arm_model import link_frames, solve_joints


def test_joints_solved_for_a_tool_position_put_the_tool_there_pointing_down() -> None:
    box, rng = Workspace(), np.random.default_rng(0)
    for tool in rng.uniform(box.low, box.high, size=(500, 3)):
        tip = link_frames(solve_joints(tool))[-1]
        assert np.allclose(tip[:3, 3], tool, atol=1e-9)
        assert np.allclose(tip[:3, :3], np.diag([1.0, -1.0, -1.0]), atol=1e-9)


def test_joints_change_little_between_neighbouring_tool_positions() -> None:
    """At 0.3 m/s and 10 ms the tool goes 3 mm a tick; no joint may jump."""
    along = np.stack([np.linspace(0.25, 0.85, 201), np.linspace(-0.35, 0.35, 201), np.full(201, 0.1)], axis=1)
    joints = np.array([solve_joints(tool) for tool in along])
    assert np.abs(np.diff(joints, axis=0)).max() < 0.05


def test_links_keep_their_distances() -> None:
    near, far = (link_frames(solve_joints(np.array(tool)))[:, :3, 3] for tool in ((0.3, 0.1, 0.2), (0.8, -0.3, 0.01)))
    assert np.allclose(np.linalg.norm(np.diff(near, axis=0), axis=1), np.linalg.norm(np.diff(far, axis=0), axis=1))
