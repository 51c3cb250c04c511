"""Pose of the arm when a camera took its image: linear between two samples."""

import anyio
import numpy as np
import pytest

from app.config import Site
from app.core.arm_pose_history import Following, pose_at
from app.core.geometry.arm_geometry import JointState
from tests.session.rig import TickedArm

HALF_TURN = np.pi


def posture(x: float, angle: float) -> JointState:
    return JointState(joints=np.full(7, angle), tool=np.array([x, 0.0, 0.3, 0.0, 1.0, 0.0, 0.0, 0.0]))


PAST = [(1.0, posture(0.30, 0.0)), (1.1, posture(0.34, 0.2)), (1.2, posture(0.34, 0.2))]


@pytest.mark.parametrize(
    ("time_s", "x", "angle"),
    [(1.0, 0.30, 0.0), (1.05, 0.32, 0.1), (1.15, 0.34, 0.2), (0.2, 0.30, 0.0), (9.0, 0.34, 0.2)],
)
def test_between_samples_it_is_between_and_beyond_them_at_the_nearest(time_s, x, angle):
    found = pose_at(PAST, time_s)
    assert found.tool[0] == pytest.approx(x)
    np.testing.assert_allclose(found.joints, angle, atol=1e-12)


def test_a_joint_that_passes_half_a_turn_goes_the_shorter_way():
    past = [(0.0, posture(0.3, HALF_TURN - 0.1)), (1.0, posture(0.3, -HALF_TURN + 0.1))]
    np.testing.assert_allclose(pose_at(past, 0.5).joints, HALF_TURN)


def test_the_way_of_the_tool_begins_and_ends_where_it_was_then():
    clock = SteppedClock()
    following = Following(TickedArm(Site()), clock)
    for clock.time_s in (1.0, 1.04, 1.08):
        following.sample()
    way = following.way(1.02, 1.06)
    assert way.shape == (3, 8)
    np.testing.assert_array_equal(way[0], way[-1])


class SteppedClock:
    """Clock that goes on only by its sleeps."""

    def __init__(self) -> None:
        self.time_s = 0.0

    def now(self) -> float:
        return self.time_s

    async def sleep(self, duration_s: float) -> None:
        self.time_s += duration_s

    def move_on_after(self, duration_s: float | None) -> anyio.CancelScope:
        return anyio.move_on_after(duration_s)
