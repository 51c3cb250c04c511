"""Approval of plans: show one, and wait for the decision of an operator or the mode."""

from typing import final

from app.config import Site, Timing
from app.core.announcer import MessageBus
from app.core.dialogue.approval import ApprovalGate, Approved, automatic_decision, drift
from app.core.errors import ApprovalRefused
from app.core.messages import Decision, Particles, Proposal
from app.core.ports import Clock
from app.core.system.channel import Latest
from app.session.perception_stage import Sensing
from app.session.state import Offer, Withdrawal
from app.session.store import SessionStore


@final
class Approving:
    """`proposals`: the one that is shown."""

    def __init__(self, site: Site, sensing: Sensing, store: SessionStore, announcer: MessageBus, clock: Clock) -> None:
        timing = site.timing
        self.proposals = Latest[Proposal]("proposals")
        self._oldest_s, self._drift_m = timing.plan_max_age_s, timing.plan_max_drift_m
        self._gate = approval_gate(timing)
        self._sensing, self._store = sensing, store
        self._announcer, self._clock = announcer, clock

    def moved_away(self, proposal: Proposal) -> bool:
        """True if the object has moved since the plan was made, which is announced."""
        moved_m = drift(proposal.observed, self._latest.positions)
        moved = moved_m > self._drift_m
        if moved:
            text = f"{proposal.id} dropped: the object moved by {moved_m * 1e3:.0f} mm meanwhile."
            self._announcer.notice("plan", text, proposal.id)
        return moved

    async def preview(self, proposal: Proposal) -> None:
        """Show it without asking for a decision, until it is void."""
        self._gate.show(None)
        self.proposals.put(proposal)
        asked = self._store.state.interruptions
        with self._store.until_interrupted(self._oldest_s):
            async for _ in self._sensing.particles.changes():
                if self.moved_away(proposal):
                    return
        self._given_up(proposal, asked)

    async def wait_for_decision(self, proposal: Proposal) -> tuple[Decision | None, Approved | None]:
        """Show it and wait for a decision: that, and leave to make the motion where it is approved and not refused.

        Neither where the proposal grew old or is void.
        """
        self._gate.show(proposal)
        self.proposals.put(proposal)
        asked = self._store.dispatch(Offer(proposal)).interruptions
        heeded: Decision | None = None
        try:
            with self._store.until_interrupted(self._oldest_s) as waiting:
                decision = await self._decision(proposal)
                if not waiting.cancel_called:
                    heeded = decision
                    return decision, self._approve(decision)
            self._given_up(proposal, asked)
            return None, None
        finally:
            self._store.dispatch(Withdrawal(heeded))

    async def _decision(self, proposal: Proposal) -> Decision:
        if self._store.state.mode == "automatic":
            return self._announcer.say(automatic_decision(proposal, now_s=self._clock.now()))
        await self._store.until(lambda state: state.decision is not None)
        assert self._store.state.decision is not None
        return self._store.state.decision

    def _approve(self, decision: Decision) -> Approved | None:
        if not decision.approve:
            why = f"Rejected by {decision.operator}: {decision.reason or 'no reason given'}."
            self._announcer.notice("approval", why, decision.proposal_id)
            return None
        if why := self._store.state.blocked_reason:
            self._announcer.notice("approval", why, decision.proposal_id)
            return None
        try:
            approved = self._gate.approve(decision, latest=self._latest, now_s=self._clock.now())
        except ApprovalRefused as refusal:
            self._announcer.notice("approval", str(refusal), decision.proposal_id)
            return None
        return self._announcer.say(approved)

    def _given_up(self, proposal: Proposal, asked: int) -> None:
        """Say why it is void: interrupted since there had been `asked` interruptions, or too old."""
        old = self._store.state.interruptions == asked
        why = "grew too old; planning again" if old else self._store.state.interrupted
        self._announcer.notice("plan", f"{proposal.id} {why}.", proposal.id)

    @property
    def _latest(self) -> Particles:
        latest = self._sensing.particles.value
        assert latest is not None, "a plan is made for particles that were seen"
        return latest


def approval_gate(timing: Timing) -> ApprovalGate:
    """The gate of a cell with these limits of age and drift."""
    return ApprovalGate(
        max_age_s=timing.plan_max_age_s, max_unseen_s=timing.object_unseen_s, max_drift_m=timing.plan_max_drift_m
    )
