"""The arm in recorded images is where its states say, evenly in between, and at the nearest beyond them."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.messages import ArmState
from app.rig.replayed.recorded_arm import RecordedArm
from tests.recording.films import BEGIN_S, states
from tests.recording.samples import Maker


def state(time_s: float, place: float) -> ArmState:
    (made,) = states([time_s], Maker(seed=8))
    pose = np.array([place, 0.0, 0.3, 0.0, 1.0, 0.0, 0.0])
    return replace(made, pose=pose, joints=np.full(7, place), opening_m=0.02)


@pytest.mark.parametrize(
    ("shown_s", "place"), [(0.0, 0.1), (0.25, 0.2), (0.5, 0.3), (0.75, 0.2), (1.0, 0.1), (-3.0, 0.1), (9.0, 0.1)]
)
def test_it_is_where_it_was_then(shown_s: float, place: float) -> None:
    past = [state(0.0, 0.1), state(0.5, 0.3), state(1.0, 0.1)]
    arm = RecordedArm(past, lambda: BEGIN_S + shown_s)
    assert arm.tool()[0] == pytest.approx(place)
    assert arm.joints() == pytest.approx(np.full(7, place))
    assert arm.tool()[7] == pytest.approx(0.02)
