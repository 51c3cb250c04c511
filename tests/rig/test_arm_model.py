"""The drawn arm reaches the whole workspace with its tool straight down."""

import numpy as np
from scipy.spatial.transform import Rotation

from app.config import Workspace
from app.core.motion import TOOL_DOWN, pointing_down
from app.rig.simulated.worlds.arm_model import link_frames, solve_joints


def test_joints_solved_for_a_tool_position_put_the_tool_there_pointing_down() -> None:
    box, rng = Workspace(), np.random.default_rng(0)
    for tool in rng.uniform(box.low, box.high, size=(500, 3)):
        tip = link_frames(solve_joints(pointing_down(tool)))[-1]
        assert np.allclose(tip[:3, 3], tool, atol=1e-9)
        assert np.allclose(tip[:3, :3], np.diag([1.0, -1.0, -1.0]), atol=1e-9)


def test_joints_change_little_between_neighbouring_tool_positions() -> None:
    """At 0.3 m/s and 10 ms the tool goes 3 mm a tick; no joint may jump."""
    along = np.stack([np.linspace(0.25, 0.85, 201), np.linspace(-0.35, 0.35, 201), np.full(201, 0.1)], axis=1)
    joints = np.array([solve_joints(pointing_down(tool)) for tool in along])
    assert np.abs(np.diff(joints, axis=0)).max() < 0.05


def test_links_keep_their_distances() -> None:
    places = (np.array([0.3, 0.1, 0.2]), np.array([0.8, -0.3, 0.01]))
    near, far = (link_frames(solve_joints(pointing_down(place)))[:, :3, 3] for place in places)
    assert np.allclose(np.linalg.norm(np.diff(near, axis=0), axis=1), np.linalg.norm(np.diff(far, axis=0), axis=1))


def test_a_tool_that_is_turned_any_way_is_held_so() -> None:
    rng = np.random.default_rng(1)
    for turn in Rotation.random(200, rng=rng):
        down = Rotation.from_quat(TOOL_DOWN, scalar_first=True)
        tilted = Rotation.from_rotvec(0.4 * turn.as_rotvec()) * down
        pose = np.array([0.5, 0.1, 0.2, *tilted.as_quat(scalar_first=True), 0.0])
        tip = link_frames(solve_joints(pose))[-1]
        assert np.allclose(tip[:3, 3], pose[:3], atol=1e-9)
        assert np.allclose(tip[:3, :3], tilted.as_matrix(), atol=1e-9)
