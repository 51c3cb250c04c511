"""A rope and a finger as tests of the rig use them, and motions that an operator has approved."""

import numpy as np

from app.core.approval import ApprovalGate, Approved
from app.core.messages import Branch, Decision, Motion, Particles, Proposal, fresh_id
from app.tasks.base import Finger, Rope

ROPE = Rope(length_m=0.40, radius_m=0.008, mass_kg=0.08, colour=(0.9, 0.25, 0.08))
FINGER = Finger(radius_m=0.009, push_height_m=0.006)
PUSH_Z = FINGER.push_height_m


def straight_rope(x_m: float = 0.50) -> np.ndarray:
    """A centreline along y through (x, 0)."""
    y = np.linspace(-ROPE.length_m / 2, ROPE.length_m / 2, 81)
    return np.stack([np.full_like(y, x_m), y, np.full_like(y, ROPE.radius_m)], axis=1)


def push(start: tuple[float, float], end: tuple[float, float], speed_m_s: float = 0.2) -> Motion:
    """A straight push at the finger's push height."""
    return Motion(positions=np.array([[*start, PUSH_Z], [*end, PUSH_Z]]), speeds=np.full(2, speed_m_s))


def approved(motion: Motion) -> Approved:
    """`motion`, shown to and approved by an operator."""
    points = straight_rope().astype(np.float32)
    branch = Branch(
        origin="policy",
        actions=np.zeros((1, 2), np.float32),
        tool_path=motion.positions.astype(np.float32),
        predicted=points,
        final=points,
        cost_before=1.0,
        cost_after=0.5,
        terms={},
        finite=True,
    )
    proposal = Proposal(
        id=fresh_id("proposal"),
        time_s=0.0,
        task="rope_push",
        particles_id=fresh_id("particles"),
        goal_id=fresh_id("goal"),
        model_id=fresh_id("model"),
        model_version=0,
        observed=points,
        branches=(branch,),
        best=0,
        motion=motion,
        chamfer_m2=0.01,
        predicted_chamfer_m2=0.005,
        plan_s=1.0,
    )
    decision = Decision(
        id=fresh_id("decision"),
        time_s=0.0,
        proposal_id=proposal.id,
        digest=motion.digest(),
        approve=True,
        operator="tests",
    )
    latest = Particles(id=fresh_id("particles"), time_s=0.0, positions=points, surface=points, reconstruction_s=0.0)
    gate = ApprovalGate(max_age_s=1.0, max_unseen_s=1.0, max_drift_m=0.001)
    gate.show(proposal)
    return gate.approve(decision, latest=latest, now_s=0.0)
