"""The approval gate: exactly what was shown, while it is true, once."""

import dataclasses

import numpy as np
import pytest

from app.core.dialogue.approval import ApprovalGate, Approved, drift
from app.core.errors import ApprovalRefused
from app.core.messages import Branch, Decision, Particles, Proposal, fresh_id
from app.core.motion import Motion

SHOWN_AT_S = 1000.0
ROPE = np.stack([np.linspace(0.4, 0.8, 60), np.zeros(60), np.full(60, 0.01)], axis=-1).astype(np.float32)


def motion(reach_m: float = 0.2) -> Motion:
    return Motion(positions=np.array([[0.4, 0.0, 0.02], [0.4, reach_m, 0.02]]), speeds=np.array([0.3, 0.1]))


def proposal(*, shown_motion: Motion | None = None) -> Proposal:
    branch = Branch(
        origin="policy",
        actions=np.zeros((2, 4), np.float32),
        tool_path=np.zeros((2, 3), np.float32),
        predicted=ROPE,
        final=ROPE,
        cost_before=1.0,
        cost_after=0.5,
        terms={},
        finite=True,
    )
    return Proposal(
        id=fresh_id("proposal"),
        time_s=SHOWN_AT_S,
        task="rope_push",
        particles_id=fresh_id("particles"),
        goal_id=fresh_id("goal"),
        model_id=fresh_id("model"),
        model_version=0,
        observed=ROPE,
        branches=(branch,),
        best=0,
        motion=shown_motion or motion(),
        chamfer_m2=0.01,
        predicted_chamfer_m2=0.005,
        plan_s=1.0,
    )


def approval_of(shown: Proposal, *, digest: str | None = None) -> Decision:
    return Decision(
        id=fresh_id("decision"),
        time_s=SHOWN_AT_S + 1.0,
        proposal_id=shown.id,
        digest=digest or shown.motion.digest(),
        approve=True,
        operator="tests",
    )


def seen(positions: np.ndarray = ROPE, *, time_s: float = SHOWN_AT_S) -> Particles:
    return Particles(
        id=fresh_id("particles"), time_s=time_s, positions=positions, surface=positions, reconstruction_s=0.0
    )


@pytest.fixture
def gate() -> ApprovalGate:
    return ApprovalGate(max_age_s=60.0, max_unseen_s=5.0, max_drift_m=0.008)


def test_the_shown_motion_is_approved_and_names_its_causes(gate):
    shown = proposal()
    gate.show(shown)
    decision = approval_of(shown)
    approved = gate.approve(decision, latest=seen(), now_s=SHOWN_AT_S + 2.0)
    assert approved.motion is shown.motion
    assert approved.digest == shown.motion.digest()
    assert approved.cause == (shown.id, decision.id)
    assert approved.operator == "tests"


def test_a_motion_is_approved_once(gate):
    shown = proposal()
    gate.show(shown)
    gate.approve(approval_of(shown), latest=seen(), now_s=SHOWN_AT_S)
    with pytest.raises(ApprovalRefused, match="no longer the one shown"):
        gate.approve(approval_of(shown), latest=seen(), now_s=SHOWN_AT_S)


def test_a_refusal_does_not_consume_the_plan(gate):
    shown = proposal()
    gate.show(shown)
    with pytest.raises(ApprovalRefused):
        gate.approve(approval_of(shown), latest=seen(ROPE + np.float32(0.1)), now_s=SHOWN_AT_S)
    gate.approve(approval_of(shown), latest=seen(), now_s=SHOWN_AT_S)


def test_nothing_is_approved_before_something_is_shown(gate):
    with pytest.raises(ApprovalRefused, match="no longer the one shown"):
        gate.approve(approval_of(proposal()), latest=seen(), now_s=SHOWN_AT_S)


@pytest.mark.parametrize("successor", [None, proposal()])
def test_a_plan_that_another_has_replaced_is_refused(gate, successor):
    replaced = proposal()
    gate.show(replaced)
    gate.show(successor)
    with pytest.raises(ApprovalRefused, match="no longer the one shown"):
        gate.approve(approval_of(replaced), latest=seen(), now_s=SHOWN_AT_S)


def test_a_digest_of_another_motion_is_refused(gate):
    shown = proposal()
    gate.show(shown)
    with pytest.raises(ApprovalRefused, match="not the motion shown"):
        gate.approve(approval_of(shown, digest=motion(0.21).digest()), latest=seen(), now_s=SHOWN_AT_S)


def test_a_plan_is_refused_from_its_age_limit_on(gate):
    shown = proposal()
    gate.show(shown)
    with pytest.raises(ApprovalRefused, match="61 s old"):
        gate.approve(approval_of(shown), latest=seen(time_s=SHOWN_AT_S + 61.0), now_s=SHOWN_AT_S + 61.0)
    gate.approve(approval_of(shown), latest=seen(time_s=SHOWN_AT_S + 60.0), now_s=SHOWN_AT_S + 60.0)


def test_a_rejection_approves_nothing(gate):
    shown = proposal()
    gate.show(shown)
    rejection = dataclasses.replace(approval_of(shown), approve=False)
    with pytest.raises(ApprovalRefused, match="rejected"):
        gate.approve(rejection, latest=seen(), now_s=SHOWN_AT_S)


def test_a_plan_is_refused_while_its_object_is_not_seen(gate):
    shown = proposal()
    gate.show(shown)
    with pytest.raises(ApprovalRefused, match="last seen 6 s ago"):
        gate.approve(approval_of(shown), latest=seen(), now_s=SHOWN_AT_S + 6.0)
    nowhere = np.full_like(ROPE, np.nan)
    with pytest.raises(ApprovalRefused, match="moved"):
        gate.approve(approval_of(shown), latest=seen(nowhere), now_s=SHOWN_AT_S)


def test_a_plan_is_refused_once_its_object_has_moved_too_far(gate):
    shown = proposal()
    gate.show(shown)
    sideways = np.array([0.0, 1.0, 0.0], np.float32)
    with pytest.raises(ApprovalRefused, match="moved by 9 mm"):
        gate.approve(approval_of(shown), latest=seen(ROPE + sideways * np.float32(0.009)), now_s=SHOWN_AT_S)
    gate.approve(approval_of(shown), latest=seen(ROPE + sideways * np.float32(0.007)), now_s=SHOWN_AT_S)


def test_drift_is_the_distance_an_object_moved_across_itself():
    moved = ROPE + np.array([0.0, 0.003, 0.004], np.float32)
    assert drift(ROPE, moved) == pytest.approx(0.005, rel=1e-4)
    assert drift(ROPE, ROPE) == 0.0


def test_only_the_gate_makes_an_approved():
    with pytest.raises(ApprovalRefused, match="Only the approval gate"):
        Approved(
            id=fresh_id("approved"),
            time_s=SHOWN_AT_S,
            proposal_id=fresh_id("proposal"),
            motion=motion(),
            digest=motion().digest(),
            operator="tests",
            seal="guessed",
        )


def test_an_approved_cannot_be_given_another_motion(gate):
    shown = proposal()
    gate.show(shown)
    approved = gate.approve(approval_of(shown), latest=seen(), now_s=SHOWN_AT_S)
    with pytest.raises(ApprovalRefused, match="not the one that was approved"):
        dataclasses.replace(approved, motion=motion(0.3))
    with pytest.raises(dataclasses.FrozenInstanceError):
        approved.motion = motion(0.3)  # pyright: ignore[reportAttributeAccessIssue]


def test_the_seal_is_not_printed(gate):
    shown = proposal()
    gate.show(shown)
    approved = gate.approve(approval_of(shown), latest=seen(), now_s=SHOWN_AT_S)
    assert approved.seal not in repr(approved)
