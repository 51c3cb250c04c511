"""Approved motions on their way to the arm."""

from collections.abc import Callable
from typing import final

from app.core.announcer import MessageBus
from app.core.dialogue.approval import Approved
from app.core.dialogue.summary import Summary
from app.core.errors import MotionRefused
from app.core.messages import Executed
from app.core.ports import Clock, Rig
from app.flow.planning import FAILURES_IN_A_ROW
from app.flow.stop_latch import StopLatch


@final
class Executing:
    """Makes motions, and counts how many the arm refused in a row."""

    def __init__(self, rig: Rig, holding: StopLatch, summary: Summary, announcer: MessageBus, clock: Clock) -> None:
        self._rig, self._holding = rig, holding
        self._announcer, self._summary = announcer, summary
        self._began_s, self._refused = clock.now(), 0

    async def execute(self, approved: Approved, do: Callable[[str], None]) -> Executed | None:
        """Make the motion; None where a stop is in force, or the arm refused it before anything moved.

        Raises the arm's MotionRefused when it has refused several motions in a row: the next would fare no better.
        """
        if not self._holding.free:
            return None
        do("pushing")
        try:
            executed = await self._rig.arm.execute(approved)
        except MotionRefused as refusal:
            self._announcer.fault("arm", refusal)
            self._refused += 1
            if self._refused >= FAILURES_IN_A_ROW:
                self._refused = 0
                raise
            return None
        self._refused = 0
        self._summary.began_moving(executed.times_s[0] - self._began_s)
        self._holding.heed(executed)
        return self._announcer.say(executed)
