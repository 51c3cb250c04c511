"""Approvals at an arm: genuine ones, each for one motion."""

import dataclasses
from typing import final

from app.core.dialogue.approval import Approved
from app.core.errors import ApprovalRefused, MotionRefused
from app.core.messages import MessageId
from app.core.rejection_codes import Refusal


@final
class UsedApprovals:
    """Approvals that an arm has taken."""

    def __init__(self) -> None:
        self._ids = set[MessageId]()

    def use(self, approved: Approved) -> None:
        """Take an approval for its motion. Raises MotionRefused where it is not genuine, or was taken before."""
        try:
            # The constructor checks seal and digest again.
            dataclasses.replace(approved)
        except ApprovalRefused as refusal:
            raise MotionRefused(Refusal.NOT_APPROVED, str(refusal)) from None
        if approved.id in self._ids:
            raise MotionRefused(Refusal.USED, "This approval has been used; an approval is for one motion.")
        self._ids.add(approved.id)
