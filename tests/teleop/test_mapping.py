"""Mapping of held axes to velocities: within the limits, and along the axes of the chosen frame."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from app.arm.jogging import Jogging
from app.config import Limits
from app.core.motion import pointing_down
from app.teleop import mapping
from app.teleop.sample import Axes, Sample

LIMITS = Limits()
TOOL = pointing_down(np.array([0.5, 0.1, 0.2]))


def turned(angle: float) -> np.ndarray:
    """The tool, turned about the vertical."""
    tool = TOOL.copy()
    turn = Rotation.from_rotvec([0, 0, angle]) * Rotation.from_quat(TOOL[3:7], scalar_first=True)
    tool[3:7] = turn.as_quat(scalar_first=True)
    return tool


def test_axes_of_the_world_are_those_of_the_world_however_the_tool_has_turned() -> None:
    jog = mapping.along(Axes(x=1.0), "world", 0.5, turned(1.0), LIMITS)
    assert jog.linear == pytest.approx([0.5 * LIMITS.speed_m_s, 0, 0])
    jog = mapping.along(Axes(z=-1.0, yaw=1.0, grip=-1.0), "world", 1.0, turned(1.0), LIMITS)
    assert jog.linear == pytest.approx([0, 0, -LIMITS.speed_m_s])
    assert jog.angular == pytest.approx([0, 0, LIMITS.angular_speed_rad_s])
    assert jog.opening < 0


def test_axes_of_the_tool_turn_with_it_and_are_those_of_the_world_before() -> None:
    straight = mapping.along(Axes(x=1.0, z=0.5), "tool", 1.0, TOOL, LIMITS)
    assert straight.linear == pytest.approx(mapping.along(Axes(x=1.0, z=0.5), "world", 1.0, TOOL, LIMITS).linear)
    aside = mapping.along(Axes(x=1.0), "tool", 1.0, turned(np.pi / 2), LIMITS)
    assert aside.linear == pytest.approx([0, LIMITS.speed_m_s, 0], abs=1e-12)


@given(*[st.floats(-1, 1)] * 4, st.floats(0, 1), st.sampled_from(["world", "tool"]), st.floats(-3, 3))
def test_no_deflection_is_faster_than_the_share_of_the_limits(x, y, z, yaw, speed, frame, angle) -> None:
    jog = mapping.along(Axes(x=x, y=y, z=z, yaw=yaw), frame, speed, turned(angle), LIMITS)
    assert np.linalg.norm(jog.linear) <= speed * LIMITS.speed_m_s + 1e-12
    assert np.linalg.norm(jog.angular) <= speed * LIMITS.angular_speed_rad_s + 1e-12


@settings(max_examples=30)
@given(st.tuples(st.floats(0.3, 0.8), st.floats(-0.3, 0.3), st.floats(0.05, 0.4)), st.floats(0.05, 1))
def test_an_aim_is_reached_without_going_beyond_it(aim, speed) -> None:
    arm, tool = Jogging(TOOL, LIMITS), TOOL
    way = np.array(aim) - TOOL[:3]
    full_speed_s = np.linalg.norm(way) / (speed * LIMITS.speed_m_s)
    for tick in range(int(100 * (full_speed_s + 10))):
        # The page speaks at 30 Hz, the arm ticks at 100.
        if tick % 3 == 0:
            jog = mapping.towards(np.array(aim), speed, tool, LIMITS)
            assert np.linalg.norm(jog.linear) <= speed * LIMITS.speed_m_s + 1e-12
            arm.aim(jog)
            if arm.at_rest:
                break
        tool = arm.advance(0.01)
        assert (tool[:3] - np.array(aim)) @ way <= 2e-3 * np.linalg.norm(way)
    assert np.linalg.norm(tool[:3] - aim) < 2e-3


def test_without_an_aim_nothing_goes_there() -> None:
    sample = Sample(axes=Axes(x=1.0), held=True, pressed=1, sequence=0, speed=1.0, towards=True)
    jog = mapping.jog(sample, TOOL, None, LIMITS)
    assert not jog.linear.any()
    assert mapping.jog(sample, TOOL, np.array([0.5, 0.0, 0.2]), LIMITS).linear[1] < 0
