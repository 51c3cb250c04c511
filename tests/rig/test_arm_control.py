"""Control of the arm: motions that it refuses, and its behaviour when it is stopped and reset."""

import dataclasses

import numpy as np
import pytest

from app.arm.gate import begin
from app.config import Site
from app.core.errors import MotionRefused
from app.core.motion import Motion, pointing_down
from app.rig.simulated.arm_control import ArmControl
from tests.rig.scene import push

HOME = pointing_down(np.array([0.30, 0.0, 0.30]))
TICK_S = 0.01
GOOD = push((0.5, 0.0), (0.6, 0.0))


def replaced(index: int, position: tuple[float, float, float]) -> Motion:
    positions = GOOD.positions.copy()
    positions[index] = position
    return Motion(positions=positions, speeds=GOOD.speeds)


REFUSED = {
    "outside the box": replaced(1, (0.90, 0.0, 0.01)),
    "under the table": replaced(0, (0.50, 0.0, -0.01)),
    "not finite": replaced(0, (np.nan, 0.0, 0.01)),
    "too fast": dataclasses.replace(GOOD, speeds=np.array([0.2, 0.31])),
    "backwards": dataclasses.replace(GOOD, speeds=np.array([0.2, -0.1])),
    "without speed": dataclasses.replace(GOOD, speeds=np.array([0.2, 0.0])),
    "infinitely fast": dataclasses.replace(GOOD, speeds=np.array([0.2, np.inf])),
    "empty": Motion(positions=np.zeros((0, 3)), speeds=np.zeros(0)),
}


def control() -> ArmControl:
    return ArmControl(Site(), HOME)


def finish(arm: ArmControl) -> None:
    for _ in range(3000):
        arm.advance(TICK_S)
        if arm.mode not in ("moving", "stopping"):
            return
    raise AssertionError("the arm does not come to rest")


@pytest.mark.parametrize("motion", REFUSED.values(), ids=REFUSED.keys())
def test_a_motion_outside_the_limits_is_refused_and_nothing_moves(motion: Motion) -> None:
    arm = control()
    with pytest.raises(MotionRefused):
        begin(arm, motion, motion.digest(), Site())
    arm.advance(TICK_S)
    assert arm.mode == "idle"
    assert np.array_equal(arm.measured, HOME)


def test_a_motion_other_than_the_approved_one_is_refused() -> None:
    arm = control()
    with pytest.raises(MotionRefused, match="digest"):
        begin(arm, GOOD, push((0.5, 0.0), (0.6, 0.01)).digest(), Site())


def test_a_motion_whose_way_there_leaves_the_workspace_is_refused() -> None:
    site = dataclasses.replace(Site(), travel_height_m=0.9)
    arm = ArmControl(site, HOME)
    with pytest.raises(MotionRefused, match="travel height"):
        begin(arm, GOOD, GOOD.digest(), site)


def test_a_motion_ends_above_its_last_position() -> None:
    arm = control()
    begin(arm, GOOD, GOOD.digest(), Site())
    assert arm.mode == "moving"
    finish(arm)
    assert arm.mode == "idle"
    assert np.allclose(arm.measured[:3], [0.6, 0.0, Site().travel_height_m], atol=1e-4)


def test_a_motion_to_where_the_arm_is_ends_at_once() -> None:
    arm = ArmControl(Site(), pointing_down(np.array([0.5, 0.0, Site().travel_height_m])))
    here = Motion(positions=arm.measured[None, :3], speeds=np.array([0.1]))
    begin(arm, here, here.digest(), Site())
    arm.advance(TICK_S)
    assert arm.mode == "idle"


def test_a_second_motion_is_refused_while_the_first_runs() -> None:
    arm = control()
    begin(arm, GOOD, GOOD.digest(), Site())
    with pytest.raises(MotionRefused, match="moving"):
        begin(arm, GOOD, GOOD.digest(), Site())


def test_a_stop_in_a_motion_brakes_and_holds_until_reset() -> None:
    arm = control()
    begin(arm, GOOD, GOOD.digest(), Site())
    for _ in range(60):
        arm.advance(TICK_S)
    arm.stop("first")
    arm.stop("second")
    finish(arm)
    at_rest = arm.measured
    assert (arm.mode, arm.reason) == ("stopped", "first")
    with pytest.raises(MotionRefused, match="stopped"):
        begin(arm, GOOD, GOOD.digest(), Site())
    arm.reset()
    arm.advance(TICK_S)
    assert arm.mode == "idle"
    assert np.allclose(arm.measured, at_rest, atol=1e-4)


def test_a_reset_does_not_end_braking() -> None:
    arm = control()
    begin(arm, GOOD, GOOD.digest(), Site())
    for _ in range(60):
        arm.advance(TICK_S)
    arm.stop("pressed")
    arm.reset()
    assert arm.mode == "stopping"
