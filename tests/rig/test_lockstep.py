"""The simulated cell in lock step makes approved motions alone, each once, inside of the arm's limits."""

import copy

import numpy as np
import pytest

from app.config import Site
from app.core.errors import MotionRefused
from app.core.geometry.scene_description import Stage
from app.core.motion import Motion
from app.core.rejection_codes import Refusal
from app.rig.simulated.lockstep import LockStep
from tests.rig.scene import FINGER, ROPE, approved, push, straight_rope

SITE = Site()
PUSH = push((0.46, 0.0), (0.52, 0.0))


@pytest.fixture
def cell() -> LockStep:
    return LockStep(Stage(body=ROPE, tool=FINGER), straight_rope(), SITE, 0)


def where(cell: LockStep) -> np.ndarray:
    """Time [s], tool and object."""
    return np.concatenate([[cell.time_s], cell.tool, cell.nodes().ravel()])


def test_a_motion_leads_back_to_its_approval(cell: LockStep) -> None:
    leave, before = approved(PUSH), cell.nodes()
    executed = cell.execute(leave)
    assert (executed.outcome, executed.approved_id, executed.cause) == ("completed", leave.id, (leave.id,))
    assert np.abs(cell.nodes() - before).max() > 0.01


@pytest.mark.parametrize(("own_s", "given_s"), [(0.1, 0.6), (2.0, 2.0)])
def test_an_object_that_is_slow_to_rest_is_given_the_time(own_s: float, given_s: float) -> None:
    cell = LockStep(Stage(body=ROPE, tool=FINGER, settle_s=own_s), straight_rope(), SITE, 0)
    assert SITE.timing.settle_s == 0.6
    executed = cell.execute(approved(PUSH))
    assert cell.time_s - executed.times_s[-1] == pytest.approx(given_s, abs=1e-6)


def test_an_approval_is_for_one_motion(cell: LockStep) -> None:
    leave = approved(PUSH)
    cell.execute(leave)
    before = where(cell)
    with pytest.raises(MotionRefused) as refused:
        cell.execute(leave)
    assert refused.value.code == Refusal.USED
    np.testing.assert_array_equal(where(cell), before)


@pytest.mark.parametrize(
    ("field", "value"), [("motion", push((0.46, 0.0), (0.60, 0.0))), ("digest", "0" * 64), ("seal", "made up")]
)
def test_what_the_gate_has_not_made_moves_nothing(cell: LockStep, field: str, value: Motion | str) -> None:
    leave, before = copy.copy(approved(PUSH)), where(cell)
    object.__setattr__(leave, field, value)
    with pytest.raises(MotionRefused) as refused:
        cell.execute(leave)
    assert refused.value.code == Refusal.NOT_APPROVED
    np.testing.assert_array_equal(where(cell), before)


def test_an_approved_motion_that_leaves_the_workspace_moves_nothing(cell: LockStep) -> None:
    before = where(cell)
    with pytest.raises(MotionRefused) as refused:
        cell.execute(approved(push((0.46, 0.0), (SITE.limits.workspace.high[0] + 0.1, 0.0))))
    assert refused.value.code == Refusal.OUTSIDE
    np.testing.assert_array_equal(where(cell), before)
