"""Transitions that tell nothing are refused in one line that says what to do."""

from dataclasses import replace

import numpy as np
import pytest

from app.calibration.checks import check_better_than_no_motion, check_contact, no_motion_m2
from app.calibration.evidence import Evidence
from app.core.errors import RecordingError

CONTACT_M = 0.017


def pushed(count: int = 3, along_m: float = 0.06) -> Evidence:
    """A straight rope along x whose middle part goes with a tool that pushes it along y."""
    x = np.linspace(-0.2, 0.2, 100)
    before = np.stack([x, np.zeros(100), np.full(100, 0.008)], axis=1)
    after = before + np.stack([np.zeros(100), along_m * np.exp(-((x / 0.1) ** 2)), np.zeros(100)], axis=1)
    way = np.stack([np.zeros(50), np.linspace(-CONTACT_M, along_m - CONTACT_M, 50), np.full(50, 0.006)], axis=1)
    stacked = [np.stack([each] * count).astype(np.float32) for each in (before, way, after)]
    return Evidence(before=stacked[0], tool=stacked[1], after=stacked[2])


def shifted(evidence: Evidence, *by_m: float) -> Evidence:
    return replace(evidence, tool=evidence.tool + np.float32(by_m))


def turned(evidence: Evidence, angle: float) -> Evidence:
    """The clouds in a frame that is turned about the vertical."""
    c, s = np.cos(angle), np.sin(angle)
    R = np.float32([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    return replace(evidence, before=evidence.before @ R, after=evidence.after @ R)


def test_pushes_that_touch_are_accepted() -> None:
    check_contact(pushed(), CONTACT_M)


@pytest.mark.parametrize("by_m", [(0.0, -0.3, 0.0), (0.0, 0.0, 0.2)])
def test_a_tool_that_never_came_near_the_object_is_refused(by_m: tuple[float, float, float]) -> None:
    still = pushed()
    still = replace(still, after=still.before)
    with pytest.raises(RecordingError, match="touched nothing; record pushes"):
        check_contact(shifted(still, *by_m), CONTACT_M)


def test_one_push_that_touches_among_others_is_enough() -> None:
    evidence = pushed()
    away = shifted(evidence, 0.0, -0.3, 0.0)
    tool = np.concatenate([evidence.tool[:1], away.tool[1:]])
    check_contact(replace(evidence, tool=tool), CONTACT_M)


def test_an_object_that_moves_with_the_tool_elsewhere_is_in_another_frame() -> None:
    with pytest.raises(RecordingError, match="different frames"):
        check_contact(shifted(pushed(), 0.5, 0.0, 0.0), CONTACT_M)


@pytest.mark.parametrize("angle", [np.pi / 2, np.pi])
def test_an_object_that_goes_another_way_than_it_is_pushed_is_in_another_frame(angle: float) -> None:
    with pytest.raises(RecordingError, match="different frames"):
        check_contact(turned(pushed(), angle), CONTACT_M)


def test_a_model_must_be_better_than_that_nothing_moves() -> None:
    evidence = pushed()
    still = no_motion_m2(evidence)
    check_better_than_no_motion(0.5 * still, evidence)
    check_better_than_no_motion(np.array([np.nan, *(0.5 * still[1:])]), evidence)
    with pytest.raises(RecordingError, match="no better"):
        check_better_than_no_motion(1.01 * still, evidence)
