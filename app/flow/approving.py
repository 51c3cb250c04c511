"""Approval of plans: show one, and wait for the decision of an operator or the mode."""

from collections.abc import Callable
from typing import final

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.approval import ApprovalGate, Approved, automatic_decision, drift
from app.core.errors import ApprovalRefused
from app.core.messages import Decision, Particles, Proposal
from app.core.ports import Clock
from app.core.system.channel import ChannelFull, Latest, Lossless
from app.flow.modes import Modes
from app.flow.perception_stage import Sensing


@final
class Approving:
    """`proposals`: the one that is shown; `asked`: that a decision is waited for.

    `blocked` says why nothing may be approved yet, and nothing where something may.
    """

    def __init__(
        self,
        site: Site,
        sensing: Sensing,
        modes: Modes,
        announcer: MessageBus,
        clock: Clock,
        *,
        blocked: Callable[[], str],
    ) -> None:
        timing = site.timing
        self.proposals = Latest[Proposal]("proposals")
        self.asked: Proposal | None = None
        self._decisions = Lossless[Decision]("decisions", bound=100)
        self._oldest_s, self._drift_m = timing.plan_max_age_s, timing.plan_max_drift_m
        self._gate = ApprovalGate(
            max_age_s=timing.plan_max_age_s, max_unseen_s=timing.object_unseen_s, max_drift_m=timing.plan_max_drift_m
        )
        self._sensing, self._modes, self._blocked = sensing, modes, blocked
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
        asked = self._modes.interruptions
        with self._modes.waiting(self._oldest_s):
            async for _ in self._sensing.particles.changes():
                if self.moved_away(proposal):
                    return
        self._given_up(proposal, asked)

    def hear(self, decision: Decision) -> None:
        """Queue a decision on the pending proposal; report any other as stale."""
        asked = self.asked
        if asked is None or asked.id != decision.proposal_id or self._modes.name == "automatic":
            self._other(decision)
            return
        try:
            self._decisions.put_nowait(decision)
        except ChannelFull:
            self._other(decision)

    async def decided(self, proposal: Proposal) -> tuple[Decision | None, Approved | None]:
        """Show it and wait for a decision: that, and leave to make the motion where it is approved and not refused.

        Neither where the proposal grew old or is void.
        """
        self._gate.show(proposal)
        self.proposals.put(proposal)
        self.asked = proposal
        try:
            return await self._decided(proposal)
        finally:
            self.asked = None
            while (late := self._decisions.get_nowait()) is not None:
                self._other(late)

    async def _decided(self, proposal: Proposal) -> tuple[Decision | None, Approved | None]:
        asked = self._modes.interruptions
        with self._modes.waiting(self._oldest_s) as waiting:
            while True:
                decision = await self._decision(proposal)
                if waiting.cancel_called:
                    break
                if decision.proposal_id == proposal.id:
                    return decision, self._approved(decision)
                self._other(decision)
        self._given_up(proposal, asked)
        return None, None

    def _other(self, decision: Decision) -> None:
        text = f"{decision.proposal_id} is not the plan shown; nothing was done."
        self._announcer.notice("approval", text)

    async def _decision(self, proposal: Proposal) -> Decision:
        if self._modes.name == "automatic":
            return self._announcer.say(automatic_decision(proposal, now_s=self._clock.now()))
        return await self._decisions.get()

    def _approved(self, decision: Decision) -> Approved | None:
        if not decision.approve:
            why = f"Rejected by {decision.operator}: {decision.reason or 'no reason given'}."
            self._announcer.notice("approval", why, decision.proposal_id)
            return None
        if why := self._blocked():
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
        old = self._modes.interruptions == asked
        why = "grew too old; planning again" if old else self._modes.interrupted
        self._announcer.notice("plan", f"{proposal.id} {why}.", proposal.id)

    @property
    def _latest(self) -> Particles:
        latest = self._sensing.particles.value
        assert latest is not None, "a plan is made for particles that were seen"
        return latest
