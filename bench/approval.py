"""An operator's approval of any motion, for benches and tests that move an arm without a plan."""

import numpy as np

from app.core.dialogue.approval import ApprovalGate, Approved
from app.core.messages import Branch, Decision, Particles, Proposal, fresh_id
from app.core.motion import Motion
from app.core.types import Points


def offered(motion: Motion, points: Points) -> Proposal:
    """`motion` as a plan for an object at `points` (N, 3) [m], which it leaves there; its costs are made up."""
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
    return Proposal(
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


def approved(motion: Motion, points: Points) -> Approved:
    """`motion`, shown to and approved by an operator who sees `points` (N, 3) [m]."""
    proposal = offered(motion, points)
    decision = Decision(
        id=fresh_id("decision"),
        time_s=0.0,
        proposal_id=proposal.id,
        digest=motion.digest(),
        approve=True,
        operator="nobody",
    )
    latest = Particles(id=fresh_id("particles"), time_s=0.0, positions=points, surface=points, reconstruction_s=0.0)
    gate = ApprovalGate(max_age_s=1.0, max_unseen_s=1.0, max_drift_m=0.001)
    gate.show(proposal)
    return gate.approve(decision, latest=latest, now_s=0.0)
