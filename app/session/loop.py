"""The loop: observe -> plan -> approve -> execute -> learn, and again from what the cameras then see.

Nothing is assumed about where the object went. A session (`stages.py`), an evaluation in lock step, and pushes that are
recorded in a world with hidden effects go round by it.
"""

from collections.abc import Coroutine
from typing import Any, Protocol, TypeVar

ObservedT = TypeVar("ObservedT")
PlanT = TypeVar("PlanT")
LeaveT = TypeVar("LeaveT")
MadeT = TypeVar("MadeT")


class LoopStages(Protocol[ObservedT, PlanT, LeaveT, MadeT]):
    """Stages of one turn; each takes what the one before it returned, and None ends the turn."""

    async def observe(self) -> ObservedT | None:
        """The object at rest; None where nothing is to be planned for it."""
        ...

    async def plan(self, observed: ObservedT) -> PlanT | None:
        """A motion for the object where it is; None where none is offered."""
        ...

    async def approve(self, plan: PlanT) -> LeaveT | None:
        """Leave to make exactly that motion, once; None where there is none."""
        ...

    async def execute(self, leave: LeaveT) -> MadeT | None:
        """The motion as it was made, to its end or not; None where none was."""
        ...

    async def learn(self, made: MadeT) -> None:
        """Look at what came of it, and learn from that."""
        ...


async def go_round(stages: LoopStages[ObservedT, PlanT, LeaveT, MadeT]) -> None:
    """Take one turn. Raises what a stage raises."""
    if (observed := await stages.observe()) is None:
        return
    if (plan := await stages.plan(observed)) is None:
        return
    if (leave := await stages.approve(plan)) is None:
        return
    if (made := await stages.execute(leave)) is None:
        return
    await stages.learn(made)


def complete(coroutine: Coroutine[Any, Any, None]) -> None:
    """Run a coroutine that never waits, without an event loop: Ctrl-C interrupts it as it does any function."""
    try:
        coroutine.send(None)
    except StopIteration:
        return
    coroutine.close()
    raise AssertionError("A stage of a loop on a clock of its own has waited.")
