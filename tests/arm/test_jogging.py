"""A tool that is moved by hand keeps to the limits whatever the hand does, and comes to rest without it."""

import dataclasses
import math

import anyio
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from app.arm.gate import begin
from app.arm.jogging import Jogging
from app.config import KeepOut, Limits, Site
from app.core.dialogue.jog import Jog
from app.core.errors import MotionRefused
from app.core.motion import pointing_down
from app.rig.simulated.arm_control import ArmControl
from tests.rig.scene import push
from tests.session.rig import TickedArm

LIMITS, TICK_S = Limits(), 0.01
HOME = pointing_down(np.array([0.30, 0.0, 0.30]))
BOX = LIMITS.workspace
STAND = KeepOut(name="stand", low=(0.60, -0.10, 0.0), high=(0.70, 0.10, 0.30))
BEAM = KeepOut(name="beam", low=(0.25, 0.05, 0.20), high=(0.85, 0.15, 0.26))

velocities = st.floats(-2.0, 2.0) | st.sampled_from([0.0, 1e308, -1e308, 1e-308])
jogs = st.builds(
    lambda numbers: Jog(linear=np.array(numbers[:3]), angular=np.array(numbers[3:6]), opening=numbers[6]),
    st.lists(velocities, min_size=7, max_size=7),
)
ticks = st.floats(0.001, 0.03)
places = st.tuples(*(st.floats(low, high) for low, high in zip(BOX.low, BOX.high, strict=True)))


def along(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Jog:
    return Jog(linear=np.array([x, y, z]))


def control() -> ArmControl:
    return ArmControl(Site(), HOME)


def jogged(arm: ArmControl, jog: Jog, ticks: int) -> None:
    for _ in range(ticks):
        arm.jog(jog)
        arm.advance(TICK_S)


def come_to_rest(arm: ArmControl) -> float:
    """Advance the arm until it is at rest; the time that this took [s]."""
    for tick in range(300):
        if arm.mode not in ("moving", "stopping"):
            return tick * TICK_S
        arm.advance(TICK_S)
    raise AssertionError("the arm does not come to rest")


@settings(max_examples=150)
@given(
    places,
    st.lists(st.tuples(jogs, st.lists(ticks, min_size=1, max_size=60)), max_size=8),
    st.booleans(),
    st.sampled_from([(), (STAND,), (STAND, BEAM)]),
)
def test_whatever_is_jogged_the_tool_stays_in_its_box_out_of_what_is_kept_free_and_within_its_limits(
    place: tuple[float, float, float],
    told: list[tuple[Jog, list[float]]],
    stop: bool,
    volumes: tuple[KeepOut, ...],
) -> None:
    limits = dataclasses.replace(LIMITS, keep_out=volumes)
    assume(limits.entered_volume(np.array([place])) is None)
    tool = Jogging(pointing_down(np.array(place)), limits)
    at, velocity, turning = pointing_down(np.array(place)), np.zeros(3), np.zeros(3)
    for jog, durations in told:
        tool.aim(jog)
        for duration_s in durations:
            now = tool.advance(duration_s)
            moved = (now[:3] - at[:3]) / duration_s
            turned = (
                Rotation.from_quat(now[3:7], scalar_first=True) * Rotation.from_quat(at[3:7], scalar_first=True).inv()
            ).as_rotvec() / duration_s
            assert BOX.contains(now[:3])
            assert limits.entered_volume(np.stack([at, now])[:, :3]) is None
            assert 0 <= now[7] <= LIMITS.opening_m
            assert np.linalg.norm(moved) <= LIMITS.speed_m_s * (1 + 1e-6)
            assert np.linalg.norm(moved - velocity) <= LIMITS.acceleration_m_s2 * duration_s + 1e-9
            assert np.linalg.norm(turned) <= LIMITS.angular_speed_rad_s * (1 + 1e-6)
            assert np.linalg.norm(turned - turning) <= LIMITS.angular_acceleration_rad_s2 * duration_s + 1e-6
            at, velocity, turning = now, moved, turned
    if stop:
        tool.brake(LIMITS.stop_deceleration_m_s2)
    tool.aim(Jog())
    for _ in range(100):
        now = tool.advance(TICK_S)
        assert BOX.contains(now[:3])
        assert limits.entered_volume(np.stack([at, now])[:, :3]) is None
        at = now
    assert tool.at_rest


def test_a_tool_before_a_volume_that_is_kept_free_stops_and_slides_along_it() -> None:
    tool = Jogging(pointing_down(np.array([0.50, 0.05, 0.2])), dataclasses.replace(LIMITS, keep_out=(STAND,)))
    tool.aim(along(x=0.2))
    for _ in range(200):
        at = tool.advance(TICK_S)
    assert at[0] == pytest.approx(STAND.low[0], abs=1e-3)
    tool.aim(along(x=0.2, y=-0.2))
    for _ in range(200):
        at = tool.advance(TICK_S)
    assert at[1] < STAND.low[1], "past its corner"
    assert at[0] > STAND.low[0] + 0.05, "and on behind that"


def test_a_tool_inside_of_such_a_volume_may_only_come_out() -> None:
    inside = pointing_down(np.array([STAND.low[0] + 0.01, 0.05, 0.2]))
    tool = Jogging(inside, dataclasses.replace(LIMITS, keep_out=(STAND,)))
    tool.aim(along(x=0.2))
    assert tool.advance(TICK_S)[0] == inside[0]
    tool.aim(along(x=-0.2))
    for _ in range(100):
        at = tool.advance(TICK_S)
    assert at[0] < STAND.low[0]


def test_a_tool_against_a_wall_slides_along_it() -> None:
    arm = control()
    jogged(arm, along(x=-0.2, y=0.2), 120)
    assert arm.measured[0] == pytest.approx(BOX.low[0], abs=1e-3)
    assert arm.velocity[1] == pytest.approx(0.2, abs=0.02)
    jogged(arm, along(x=0.1), 100)
    assert arm.measured[0] > BOX.low[0] + 0.05, "and comes off again"


def test_a_tool_outside_of_the_box_may_only_come_back() -> None:
    outside = pointing_down(np.array([BOX.low[0] - 0.05, 0.0, 0.2]))
    tool = Jogging(outside, LIMITS)
    tool.aim(along(x=-0.2))
    assert np.array_equal(tool.advance(TICK_S), outside)
    tool.aim(along(x=0.2))
    for _ in range(100):
        tool.advance(TICK_S)
    assert tool.advance(TICK_S)[0] > BOX.low[0]


def test_it_moves_turns_and_opens_as_it_is_told() -> None:
    arm = control()
    jogged(arm, Jog(linear=np.array([0.1, 0.0, 0.0]), angular=np.array([0.0, 0.0, 0.5]), opening=0.02), 150)
    assert arm.mode == "moving"
    assert arm.velocity == pytest.approx([0.1, 0.0, 0.0], abs=1e-3)
    arm.jog(Jog())
    come_to_rest(arm)
    assert arm.mode == "idle"
    turned = Rotation.from_quat(arm.measured[3:7], scalar_first=True)
    turned *= Rotation.from_quat(HOME[3:7], scalar_first=True).inv()
    assert turned.as_rotvec() == pytest.approx([0.0, 0.0, 0.75], abs=0.05)
    assert 0.02 < arm.measured[7] < 0.04
    assert arm.measured[:3] == pytest.approx(arm.commanded[:3], abs=1e-4)


def test_it_slows_down_where_nobody_says_anything_any_more() -> None:
    arm = control()
    jogged(arm, along(y=0.3), 80)
    arm.decelerate()
    assert come_to_rest(arm) < 0.5
    assert arm.mode == "idle"


def test_stop_wins_brakes_harder_and_holds_until_reset() -> None:
    arm = control()
    jogged(arm, along(y=0.3), 80)
    arm.stop("pressed")
    assert arm.mode == "stopping"
    assert not arm.jog(along(y=0.3))
    before = arm.measured[1]
    assert come_to_rest(arm) < 0.15
    assert arm.measured[1] - before < 0.3**2 / (2 * LIMITS.stop_deceleration_m_s2) + 0.005
    assert (arm.mode, arm.reason) == ("stopped", "pressed")
    jogged(arm, along(y=0.3), 20)
    assert arm.mode == "stopped"
    arm.reset()
    jogged(arm, along(y=0.3), 20)
    assert arm.mode == "moving"


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", ["linear", "angular", "opening"])
def test_a_jog_that_is_not_finite_counts_as_none(field: str, number: float) -> None:
    wrong = dataclasses.replace(along(), **{field: number if field == "opening" else np.array([0.1, number, 0.0])})
    arm = control()
    assert not arm.jog(wrong)
    assert arm.mode == "idle"
    jogged(arm, along(y=0.2), 50)
    assert not arm.jog(wrong)
    arm.advance(TICK_S)
    assert arm.velocity[1] == pytest.approx(0.2, abs=0.01)


def test_no_motion_begins_while_it_is_jogged_and_no_jog_is_heeded_in_a_motion() -> None:
    motion = push((0.5, 0.0), (0.6, 0.0))
    arm = control()
    jogged(arm, along(y=0.1), 10)
    with pytest.raises(MotionRefused, match="moving"):
        begin(arm, motion, motion.digest(), Site())
    arm.decelerate()
    come_to_rest(arm)
    begin(arm, motion, motion.digest(), Site())
    assert not arm.jog(along(y=0.3))
    arm.decelerate()
    arm.advance(TICK_S)
    assert arm.mode == "moving"


def test_a_jog_of_nothing_begins_nothing() -> None:
    arm = control()
    assert arm.jog(Jog())
    arm.advance(TICK_S)
    assert arm.mode == "idle"
    assert np.array_equal(arm.measured, HOME)


@pytest.mark.anyio
async def test_the_arm_of_the_flows_tests_is_moved_by_hand_as_well() -> None:
    arm, stretches = TickedArm(Site()), []

    async def wait() -> None:
        stretches.append(await arm.accept_jogs())

    assert not arm.jog(along(y=0.1))
    for then in (lambda: None, arm.stop):
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(wait)
            for _ in range(10):
                await anyio.sleep(0.03)
                assert arm.jog(along(y=0.1))
            then()
        assert (await arm.state()).mode in ("idle", "stopped")
    assert [(stretch.outcome, stretch.reason) for stretch in stretches] == [
        ("completed", ""),
        ("stopped", "STOP was pressed."),
    ]
    assert 0.02 < arm.tool()[1] < 0.1
    with pytest.raises(MotionRefused):
        await arm.accept_jogs()
